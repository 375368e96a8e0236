"""Settings of the Foxglove service."""

from dataclasses import dataclass
from pathlib import Path

# Origins of Foxglove's and Lichtblick's own applications; other programs send no Origin header.
ORIGINS = ("https://app.foxglove.dev", "file://")


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Settings of the Foxglove service.

    Attributes:
        listen: `HOST:PORT`; port 0 takes a free one.
        robots: Robots to show, as `robot` or `site/robot`; empty for all of the mesh.
        site: Site of the service's presence; empty for the first site found.
        metrics: Host and port of the Prometheus endpoint; None for none.
        operator: Name of the operator that commands carry; if empty, only stop is offered.
        origins: Origins of permitted web pages, in addition to this machine's and `ORIGINS`.
        certificate: PEM file for TLS, with its private key or without (`private_key`).
        insecure: May listen beyond loopback without TLS.
        gone_after_s: Time offline after which a robot's channels are removed; longer than a restart of a
            service or a router takes.
    """

    listen: str = "127.0.0.1:8765"
    robots: tuple[str, ...] = ()
    site: str = ""
    metrics: tuple[str, int] | None = None
    operator: str = ""
    origins: tuple[str, ...] = ()
    certificate: Path | None = None
    private_key: Path | None = None
    insecure: bool = False
    gone_after_s: float = 30.0

    def wants(self, site: str, robot: str) -> bool:
        """Return whether to show a robot."""
        return not self.robots or robot in self.robots or f"{site}/{robot}" in self.robots
