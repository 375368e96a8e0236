"""Proofs of a robot and its real controller: its joints are those of the model, its stop ends motions.

A proof is valid for the model, the driver and the software of the controller with which it was made.
"""

from dataclasses import dataclass
from datetime import date

from protocol_gateway.seam import Capabilities, Stop
from robomesh import reason_codes as codes
from robomesh.reasons import Reason
from robots.descriptions.description import RobotDescription
from robots.kinematics.kinematic_tree import tree_of
from robots.kinematics.verification import joints_sha256
from robots.kinematics.verification_record import VerificationRecord


@dataclass(frozen=True, kw_only=True)
class StopProof:
    """A successful trial of the stop on a real controller (docs/safety.md).

    Attributes:
        driver: Protocol of the site file.
        means: `Capabilities.stop_means`.
        software: Version of the controller's software.
    """

    driver: str
    means: str
    software: str
    date: date


class ControllerProofs:
    """Proofs of one robot.

    Args:
        robot: <site>/<robot>.
        protocol: Its driver, as the site file names it.
        simulated: The controller is a simulator of robomesh, which needs no proofs.
        verified: Comparison of its joints; None: there is none.
        stop: Trial of its stop; True: made, of a driver that stops in one way only; False: not made.
        experimental: The site file allows commands that were never tried on a real controller.

    Attributes:
        joints_sha256: Hash of the model and the mapping that a comparison of the joints must have; empty: the
            joints cannot be compared.
    """

    def __init__(
        self,
        robot: str,
        description: RobotDescription,
        capabilities: Capabilities,
        *,
        protocol: str,
        simulated: bool,
        verified: VerificationRecord | None,
        stop: StopProof | bool,
        experimental: bool,
    ) -> None:
        self._robot, self._capabilities, self._protocol = robot, capabilities, protocol
        self._simulated, self._verified, self._stop, self._experimental = (
            simulated,
            verified,
            stop,
            experimental,
        )
        self.joints_sha256 = (
            joints_sha256(tree_of(description), f"{protocol} {capabilities.joint_mapping}")
            if capabilities.reports_pose and capabilities.no_joints is None
            else ""
        )

    def why_joints_unproven(self, software: str) -> Reason | None:
        """Return why the joints that the controller sends may not be those of the model; None: they are.

        Args:
            software: Version of the controller's software; empty: not known.
        """
        if self._simulated or not self.joints_sha256:
            return None
        found = self._verified
        if found is None:
            return codes.JOINTS_NOT_VERIFIED(robot=self._robot)
        if found.robot != self._robot:
            return codes.JOINTS_OF_OTHER_ROBOT(robot=self._robot, other=found.robot)
        if not found.agrees:
            return codes.JOINTS_DISAGREE(time=found.time)
        if found.joints_sha256 != self.joints_sha256:
            return codes.JOINTS_OTHER_MODEL(time=found.time)
        if software != found.software:
            before, now = (each or "not known" for each in (found.software, software))
            return codes.JOINTS_OTHER_SOFTWARE(before=before, now=now)
        return None

    def why_read_only(self, software: str) -> Reason | None:
        """Return why no command may be sent to the controller; None: commands may be sent.

        Args:
            software: See `why_joints_unproven`.
        """
        capabilities, proof = self._capabilities, self._stop
        if not capabilities.commands:
            off = codes.MOTION_OFF(protocol=self._protocol)
            return off if capabilities.can_be_moved else codes.READS_ONLY()
        if Stop not in capabilities.commands:
            return codes.NO_STOP_CODE()
        if self._simulated and proof is True:
            return None
        if capabilities.experimental and not self._experimental:
            return codes.EXPERIMENTAL(protocol=self._protocol)
        if not proof:
            return codes.STOP_NOT_PROVEN()
        if not capabilities.stop_means and proof is True:
            return None
        if not isinstance(proof, StopProof):
            return codes.STOP_PROOF_SHORT(driver=self._protocol, means=capabilities.stop_means)
        tried, used = f"{proof.driver}, {proof.means}", f"{self._protocol}, {capabilities.stop_means}"
        if tried != used:
            return codes.STOP_OTHER_MEANS(before=tried, now=used)
        # An unknown version permits stops, but no motions (`software_unknown`).
        if software not in ("", proof.software):
            return codes.STOP_OTHER_SOFTWARE(before=proof.software, now=software)
        return None

    def why_software_unknown(self, software: str) -> Reason | None:
        """Return why no motion may be sent: the stop was proven with a version that is not confirmed yet.

        Args:
            software: See `why_joints_unproven`.
        """
        proof = self._stop
        if software or self._simulated or not isinstance(proof, StopProof) or not proof.software:
            return None
        return codes.STOP_OTHER_SOFTWARE(before=proof.software, now="not known")
