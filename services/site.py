"""The site file: what runs at a site. Every service gets its part from here, as Settings.

Degrees and millimetres in the file, SI in what is read from it.
"""

import tomllib
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, StrictBool, ValidationError, field_validator

from bus import keys
from bus.endpoints import Tls
from bus.errors import KeyNameError
from robots import description
from robots.description import Pose
from services.errors import ListenError, SiteFileError
from services.listen import split_address

Pixels = Annotated[int, Field(ge=64, le=4096, multiple_of=2)]
Triple = tuple[float, float, float]
Quiet = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class TlsFiles(BaseModel):
    """Certificates of this end (PEM)."""

    model_config = Quiet
    ca: Path
    certificate: Path
    key: Path


class Router(BaseModel):
    """The site's router."""

    model_config = Quiet
    listen: tuple[str, ...] = ("tcp/127.0.0.1:7447",)
    connect: tuple[str, ...] = ()
    tls: TlsFiles | None = None
    insecure: StrictBool = False


class Robot(BaseModel):
    """An arm and its controller."""

    model_config = Quiet
    name: str
    model: str
    pose: Pose = Pose()
    cell: str = ""
    controller: str = "simulated"
    protocol: Literal["unit"] = "unit"
    codes: dict[int, str] = Field(default_factory=dict)
    accept_unknown: tuple[Literal["mode", "homed"], ...] = ()
    # Whether somebody tried the stop unit on this controller; without that nothing is ever sent to it.
    stop_proven: StrictBool | None = None
    stale_after_s: Annotated[float, Field(gt=0.05, le=60)] = 1.0
    demo: StrictBool = False

    @field_validator("name")
    @classmethod
    def _name(cls, name: str) -> str:
        return _checked_name(name, "robot")

    @field_validator("codes", mode="before")
    @classmethod
    def _codes(cls, codes: Any) -> Any:
        # TOML's keys are text.
        return {int(k): v for k, v in codes.items()} if isinstance(codes, dict) else codes

    @field_validator("controller")
    @classmethod
    def _controller(cls, controller: str) -> str:
        if controller == "simulated":
            return controller
        scheme, _, address = controller.partition("://")
        if scheme != "tcp":
            raise ValueError("should be 'simulated' or tcp://HOST:PORT, as in tcp://10.0.0.7:5400")
        try:
            split_address(address)
        except ListenError:
            raise ValueError("should be 'simulated' or tcp://HOST:PORT, as in tcp://10.0.0.7:5400") from None
        return controller

    @property
    def simulated(self) -> bool:
        """Whether its controller is ours, and simulated."""
        return self.controller == "simulated"

    @property
    def can_be_stopped(self) -> bool:
        """Whether the stop unit is proven: said so, or our own simulated controller."""
        return self.simulated if self.stop_proven is None else self.stop_proven


class Recorder(BaseModel):
    """Where recordings go."""

    model_config = Quiet
    folder: Path = Path("recordings")


class Renderer(BaseModel):
    """Which views are rendered, and how large."""

    model_config = Quiet
    views: tuple[str, ...] = ("front", "top", "left", "free")
    # H.264 halves the resolution of colour.
    size: tuple[Pixels, Pixels] = (1280, 720)
    fps: Annotated[float, Field(ge=1, le=120)] = 30


class Console(BaseModel):
    """Where the page is served."""

    model_config = Quiet
    listen: str = "127.0.0.1:8080"
    # Names that people reach it by, beside addresses and localhost.
    hosts: tuple[str, ...] = ()
    insecure: StrictBool = False


class Audit(BaseModel):
    """Where the gateway keeps what was asked of each robot."""

    model_config = Quiet
    folder: Path = Path("audit")


class Site(BaseModel):
    """A whole site."""

    model_config = Quiet
    site: str
    router: Router = Router()
    robot: tuple[Robot, ...] = ()
    recorder: Recorder = Recorder()
    renderer: Renderer = Renderer()
    console: Console = Console()
    audit: Audit = Audit()

    @field_validator("site")
    @classmethod
    def _site(cls, name: str) -> str:
        return _checked_name(name, "site")

    @field_validator("robot")
    @classmethod
    def _robots(cls, robots: tuple[Robot, ...]) -> tuple[Robot, ...]:
        names = [robot.name for robot in robots]
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"two robots are named {name!r}: every robot needs a name of its own")
        return robots

    @property
    def tls(self) -> Tls | None:
        """Certificates for the site's own sessions."""
        files = self.router.tls
        return None if files is None else Tls(ca=files.ca, certificate=files.certificate, key=files.key)


def load(path: Path | None) -> Site:
    """The site of a file; without one the built-in site `demo`.

    Paths in the file are taken from the file's own folder.

    Raises:
        SiteFileError: A line a problem: file, key, value, and what would be right.
        DescriptionError: If a robot's model is not right.
    """
    if path is None:
        return DEMO
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise SiteFileError(f"{path}: cannot be read: {reason}") from None
    try:
        values = tomllib.loads(text)
        site = Site.model_validate(values)
    except tomllib.TOMLDecodeError as error:
        raise SiteFileError(f"{path}: not TOML: {error}") from None
    except ValidationError as error:
        raise SiteFileError(
            "\n".join(_sentence(path, problem, values) for problem in error.errors())
        ) from None
    site = _beside(site, path.parent)
    for robot in site.robot:
        # What no service could run with is told before any starts.
        description.load(robot.model)
    return site


def _beside(site: Site, folder: Path) -> Site:
    robots = tuple(
        robot.model_copy(update={"model": str(folder / robot.model)})
        if robot.model.endswith((".toml", ".urdf")) and not Path(robot.model).is_absolute()
        else robot
        for robot in site.robot
    )
    return site.model_copy(
        update={
            "robot": robots,
            "recorder": site.recorder.model_copy(update={"folder": folder / site.recorder.folder}),
            "audit": site.audit.model_copy(update={"folder": folder / site.audit.folder}),
        }
    )


def _sentence(path: Path, problem: Any, values: dict[str, Any]) -> str:
    """One of pydantic's problems as one line: file, key, value and what would be right."""
    parts = list(problem["loc"])
    if len(parts) > 1 and isinstance(parts[1], int):
        row = values[parts[0]][parts[1]]
        parts[1] = row.get("name", parts[1] + 1) if isinstance(row, dict) else parts[1] + 1
    where = ".".join(map(str, parts))
    if problem["type"] == "missing":
        return f"{path}: {where} is missing"
    if problem["type"] == "extra_forbidden":
        later = _LATER.get(str(parts[-1]))
        if later is not None:
            return f"{path}: {where} would do nothing yet, take it out: {later}"
        return f"{path}: {where} is not a key that a site file has"
    message = problem["msg"].removeprefix("Value error, ")
    return f"{path}: {where} = {problem['input']!r}: {message}"


def _checked_name(name: str, what: str) -> str:
    try:
        return keys.check_name(name, what)
    except KeyNameError as error:
        raise ValueError(str(error)) from None


# Keys of the contract that nothing reads yet: whoever writes one must not believe that it works.
_LATER = {
    "check": "motions are checked against limits, not yet against collisions",
    "fixture": "nothing checks collisions with what stands in a cell yet",
    "legacy_clients": "old client programs cannot attach to the gateway yet",
}

# What runs without a file.
DEMO = Site(site="demo", robot=(Robot(name="pt600", model="pt600", demo=True),))
