"""What a bridge to Foxglove is told."""

from dataclasses import dataclass
from pathlib import Path

# Where Foxglove's and Lichtblick's own programs come from; a program that is no browser tells none.
ORIGINS = ("https://app.foxglove.dev", "file://")


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Where it listens, and what it lets through.

    Attributes:
        listen: `HOST:PORT`; port 0 takes a free one.
        robots: `robot` or `site/robot`; none: all of the mesh.
        site: Where it is present itself; empty: at the first site that is seen.
        metrics: Host and port at which Prometheus may ask; None: nowhere.
        operator: In whose name commands are asked; empty: none but stop are offered.
        origins: Of web pages that may attach, beside those of this machine and `ORIGINS`.
        certificate: PEM, for TLS, with its key in it or in `private_key`.
        insecure: Beyond loopback without TLS, at one's own risk.
        gone_after_s: A robot that was away for so long has no channels any more; a restarted service, or
            router, is back before.
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
        """Whether a robot is to be shown."""
        return not self.robots or robot in self.robots or f"{site}/{robot}" in self.robots
