"""Search of a server for a motion device of OPC 40010-1, and for the site file's nodes."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from asyncua import ua

from controllers.opcua import facts
from controllers.opcua.facts import Item, order_of
from controllers.opcua.reader.problems import ReadingError
from controllers.opcua.reader.session import HAS_SUBTYPE, NAMESPACES, ReadOnlySession
from controllers.opcua.settings import OpcUaSettings
from controllers.opcua.units import UNECE, Unit

ROBOTICS = "http://opcfoundation.org/UA/Robotics/"
SYSTEM, DEVICE, AXIS, POWER_TRAIN = 1002, 1004, 16601, 16794
MOTOR, SAFETY, CONTROLLER, TASK = 1019, 1013, 1003, 1011
TYPES = frozenset({SYSTEM, DEVICE, AXIS, POWER_TRAIN, MOTOR, SAFETY, CONTROLLER, TASK})
"""Types of OPC 40010-1, by their identifiers in its namespace."""
CONTROLS, MOVES = 4002, 18178
"""References from a controller to its devices, and from a power train to its axes."""

_OBJECTS, _SERVER = ua.NodeId(85, 0), ua.NodeId(2253, 0)
_NAME, _VERSION = ua.NodeId(2261, 0), ua.NodeId(2264, 0)
_DEEPEST, _MOST_OBJECTS = 6, 2000
_MOST_SUPERTYPES = 12


@dataclass(frozen=True, slots=True)
class Variable:
    """Variable to subscribe to, and what it is."""

    node: ua.NodeId
    item: Item


@dataclass(slots=True)
class _Child:
    """A node below another."""

    node: ua.NodeId
    name: str
    type_: int
    variable: bool


@dataclass(slots=True)
class _Device:
    """A motion device, and the system that contains it."""

    node: ua.NodeId
    name: str
    system: ua.NodeId


@dataclass(slots=True)
class _Wanted:
    """A variable of which the unit is not read yet."""

    node: ua.NodeId
    kind: str
    name: str = ""
    profile: ua.NodeId | None = None


@dataclass
class Discovery:
    """Search of one server.

    Attributes:
        namespaces: Its namespaces.
    """

    session: ReadOnlySession
    settings: OpcUaSettings
    namespaces: list[str] = field(default_factory=list)
    _kinds: dict[ua.NodeId, int] = field(default_factory=dict)

    async def run(self) -> tuple[list[Variable], str]:
        """Return the variables to read, and the server's name and version.

        Raises:
            ReadingError: If there is nothing to read, or a device or namespace of the settings is missing.
        """
        namespaces, name, version = await self.session.values((NAMESPACES, _NAME, _VERSION))
        self.namespaces = [str(each) for each in namespaces or ()]
        wanted: list[_Wanted] = []
        if ROBOTICS in self.namespaces:
            device = self._chosen(await self._devices())
            if device is not None:
                wanted += await self._of_device(device)
        for joint in self.settings.joints:
            if joint.node:
                wanted.append(_Wanted(self._node(joint.node), facts.POSITION, joint.node))
        for signal in self.settings.signals:
            wanted.append(_Wanted(self._node(signal.node), facts.DECLARED, signal.name))
        if not wanted:
            raise ReadingError(
                "the server has no motion device of OPC 40010-1: map its nodes in [robot.opcua] joints and "
                "signals"
            )
        if len(wanted) > facts.MOST_ITEMS:
            raise ReadingError(f"{len(wanted)} variables would be read; {facts.MOST_ITEMS} at most")
        text = f"OPC UA server {name or 'without a name'}, software {version or 'unknown'}"
        return await self._with_units(wanted), text

    # ------------------------------------------------------------------------- devices

    async def _devices(self) -> list[_Device]:
        """Return all motion devices, found by their types."""
        found: list[_Device] = []
        level, seen = [_OBJECTS], {_OBJECTS, _SERVER}
        for _ in range(_DEEPEST):
            below: list[ua.NodeId] = []
            for children in await self._children(level):
                for child in children:
                    if child.variable or child.node in seen or len(seen) >= _MOST_OBJECTS:
                        continue
                    seen.add(child.node)
                    if child.type_ == SYSTEM:
                        found += await self._devices_of(child.node)
                    else:
                        below.append(child.node)
            if not below:
                break
            level = below
        return found

    async def _devices_of(self, system: ua.NodeId) -> list[_Device]:
        children = await self._below(system, "MotionDevices")
        return [_Device(each.node, each.name, system) for each in children if each.type_ == DEVICE]

    def _chosen(self, devices: Sequence[_Device]) -> _Device | None:
        names = ", ".join(each.name for each in devices)
        if self.settings.device:
            for each in devices:
                if each.name == self.settings.device:
                    return each
            raise ReadingError(
                f"the server has no motion device {self.settings.device!r}; it has {names or 'none'}"
            )
        if len(devices) > 1:
            raise ReadingError(f"the server has several motion devices: write device, one of {names}")
        return devices[0] if devices else None

    async def _of_device(self, device: _Device) -> list[_Wanted]:
        wanted: list[_Wanted] = []
        (children,) = await self._children([device.node])
        for child in children:
            if child.name in ("Manufacturer", "Model", "SerialNumber") and child.variable:
                kind = "serial" if child.name == "SerialNumber" else child.name.lower()
                wanted.append(_Wanted(child.node, kind))
        wanted += await self._parameters(
            device.node, {"SpeedOverride": "override", "InControl": "in_control", "OnPath": "on_path"}
        )
        axes = [each for each in await self._below(device.node, "Axes") if each.type_ == AXIS]
        for axis in (axes[each] for each in order_of([axis.name for axis in axes])):
            (parts,) = await self._children([axis.node])
            profile = next((each.node for each in parts if each.name == "MotionProfile"), None)
            kinds = {"ActualPosition": facts.POSITION, "ActualSpeed": facts.SPEED}
            for each in await self._parameters(axis.node, kinds, axis.name):
                each.profile = profile
                wanted.append(each)
        wanted += await self._motors(device, {axis.node: axis.name for axis in axes})
        load = next((each for each in children if each.name == "FlangeLoad"), None)
        if load is not None:
            wanted += [_Wanted(each.node, "mass") for each in await self._variables(load.node, {"Mass"})]
        for safety in await self._below(device.system, "SafetyStates"):
            kinds = {
                "OperationalMode": "mode",
                "EmergencyStop": "emergency_stop",
                "ProtectiveStop": "protective_stop",
            }
            if safety.type_ == SAFETY:
                wanted += await self._parameters(safety.node, kinds)
        wanted += await self._controllers(device)
        return wanted

    async def _motors(self, device: _Device, axes: dict[ua.NodeId, str]) -> list[_Wanted]:
        """Return the motors' temperatures; a power train that moves one axis has that axis's name."""
        wanted: list[_Wanted] = []
        for train in await self._below(device.node, "PowerTrains"):
            if train.type_ != POWER_TRAIN:
                continue
            (moved,) = await self.session.references([train.node], self._robotics(MOVES))
            names = {axes[_plain(each.NodeId)] for each in moved if _plain(each.NodeId) in axes}
            (parts,) = await self._children([train.node])
            motors = [each for each in parts if each.type_ == MOTOR]
            name = names.pop() if len(names) == 1 and len(motors) == 1 else ""
            for motor in motors:
                kinds = {"MotorTemperature": facts.MOTOR}
                wanted += await self._parameters(motor.node, kinds, name or f"{train.name}/{motor.name}")
        return wanted

    async def _controllers(self, device: _Device) -> list[_Wanted]:
        """Return what the device's controller reports; of several, that which refers to the device."""
        controllers = [
            each for each in await self._below(device.system, "Controllers") if each.type_ == CONTROLLER
        ]
        if len(controllers) > 1:
            referred = await self.session.references(
                [each.node for each in controllers], self._robotics(CONTROLS)
            )
            own = [
                controller
                for controller, references in zip(controllers, referred, strict=True)
                if any(_plain(each.NodeId) == device.node for each in references)
            ]
            controllers = own or controllers
        wanted: list[_Wanted] = []
        for controller in controllers:
            wanted += await self._parameters(controller.node, {"Temperature": "temperature"})
            for software in (await self._below(controller.node, "Software"))[:1]:
                found = await self._variables(software.node, {"SoftwareRevision"})
                wanted += [_Wanted(each.node, "software") for each in found]
            tasks = [
                each for each in await self._below(controller.node, "TaskControls") if each.type_ == TASK
            ]
            for task in (tasks[each] for each in order_of([task.name for task in tasks])):
                kinds = {
                    "TaskProgramName": "program",
                    "TaskProgramLoaded": "loaded",
                    "ExecutionMode": "execution",
                }
                wanted += await self._parameters(task.node, kinds)
        return wanted

    # --------------------------------------------------------------------------- nodes

    async def _children(self, nodes: Sequence[ua.NodeId]) -> list[list[_Child]]:
        found: list[list[_Child]] = []
        for references in await self.session.references(nodes):
            children: list[_Child] = []
            for each in references:
                name = each.BrowseName.Name or ""
                # A placeholder of a type, which some servers copy into their instances.
                if name.startswith("<"):
                    continue
                variable = each.NodeClass == ua.NodeClass.Variable
                if variable or each.NodeClass == ua.NodeClass.Object:
                    kind = 0 if variable else await self._kind(_plain(each.TypeDefinition))
                    children.append(_Child(_plain(each.NodeId), name, kind, variable))
            found.append(children)
        return found

    async def _below(self, node: ua.NodeId, folder: str) -> list[_Child]:
        """Return the objects in a folder of a node."""
        (children,) = await self._children([node])
        folders = [each.node for each in children if each.name == folder and not each.variable]
        found = await self._children(folders)
        return [each for part in found for each in part if not each.variable]

    async def _variables(self, node: ua.NodeId, names: set[str]) -> list[_Child]:
        (children,) = await self._children([node])
        return [each for each in children if each.variable and each.name in names]

    async def _parameters(self, node: ua.NodeId, kinds: dict[str, str], name: str = "") -> list[_Wanted]:
        """Return the variables of a node's ParameterSet that have a kind."""
        (children,) = await self._children([node])
        sets = [each.node for each in children if each.name == "ParameterSet"]
        return [
            _Wanted(each.node, kinds[each.name], name)
            for part in await self._children(sets)
            for each in part
            if each.variable and each.name in kinds
        ]

    async def _kind(self, type_: ua.NodeId) -> int:
        """Return the type of OPC 40010-1 that a type is, or is derived from; 0: none."""
        known = self._kinds.get(type_)
        if known is not None:
            return known
        kind, at = 0, type_
        for _ in range(_MOST_SUPERTYPES):
            namespace = self.namespaces[at.NamespaceIndex : at.NamespaceIndex + 1]
            if namespace == [ROBOTICS] and at.Identifier in TYPES:
                kind = int(at.Identifier)
                break
            if at.NamespaceIndex == 0:
                break
            (above,) = await self.session.references([at], HAS_SUBTYPE, ua.BrowseDirection.Inverse)
            if not above:
                break
            at = _plain(above[0].NodeId)
        self._kinds[type_] = kind
        return kind

    def _robotics(self, number: int) -> ua.NodeId:
        return ua.NodeId(number, self.namespaces.index(ROBOTICS))

    def _node(self, text: str) -> ua.NodeId:
        """Return the node of the site file's NodeId."""
        uri, separator, rest = text.removeprefix("nsu=").partition(";")
        if text.startswith("nsu=") and separator:
            if uri not in self.namespaces:
                raise ReadingError(f"node {text}: the server has no namespace {uri}")
            text = f"ns={self.namespaces.index(uri)};{rest}"
        try:
            node: ua.NodeId = ua.NodeId.from_string(text)
        except Exception:
            raise ReadingError(f"node {text!r}: no NodeId, as ns=2;s=Robot.J1 is one") from None
        return node

    async def _with_units(self, wanted: Sequence[_Wanted]) -> list[Variable]:
        """Return the variables with their units and motion profiles."""
        properties = await self.session.references([each.node for each in wanted])
        units = [
            next(
                (_plain(each.NodeId) for each in part if each.BrowseName.Name == "EngineeringUnits"),
                None,
            )
            for part in properties
        ]
        stated = await self._values_of(units)
        profiles = await self._values_of([each.profile for each in wanted])
        return [
            Variable(
                each.node,
                Item(
                    each.kind,
                    each.name[: facts.LONGEST_TEXT],
                    _unit(unit),
                    profile if isinstance(profile, int) else 0,
                ),
            )
            for each, unit, profile in zip(wanted, stated, profiles, strict=True)
        ]

    async def _values_of(self, nodes: Sequence[ua.NodeId | None]) -> list[object]:
        """Return the value of each node; None stays None."""
        values = iter(await self.session.values([each for each in nodes if each is not None]))
        return [None if each is None else next(values) for each in nodes]


def _unit(value: object) -> Unit:
    """Return a stated unit; the number of another system than UNECE's is not used."""
    if not isinstance(value, ua.EUInformation):
        return Unit()
    number = int(value.UnitId or 0) if value.NamespaceUri in (UNECE, None, "") else 0
    text = value.DisplayName.Text if value.DisplayName is not None else None
    return Unit(max(number, 0), (text or "")[: facts.LONGEST_TEXT])


def _plain(node: ua.NodeId) -> ua.NodeId:
    """Return a node's id as one that compares equal, without the parts of an ExpandedNodeId."""
    return ua.NodeId(node.Identifier, node.NamespaceIndex)
