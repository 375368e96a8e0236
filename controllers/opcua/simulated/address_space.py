"""Nodes of the server: the part of OPC 40010-1 that a robot arm needs, with its types' own identifiers.

A type here has only what its instances have, which is less than in the nodeset of the OPC Foundation.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from asyncua import Server, ua
from asyncua.common.node import Node

ROBOTICS = "http://opcfoundation.org/UA/Robotics/"
DEVICES = "http://opcfoundation.org/UA/DI/"
INSTANCES = "urn:robomesh:simulated:robot"

_UNECE = "http://www.opcfoundation.org/UA/units/un/cefact"
_TYPES = {
    "MotionDeviceSystemType": 1002,
    "MotionDeviceType": 1004,
    "AxisType": 16601,
    "PowerTrainType": 16794,
    "MotorType": 1019,
    "LoadType": 1018,
    "SafetyStateType": 1013,
    "ControllerType": 1003,
    "TaskControlType": 1011,
}
_SOFTWARE_TYPE = 15106
_MOVES = 18178
_DEVICE_SET = 5001
_ARTICULATED_ROBOT = 1


@dataclass(frozen=True, slots=True)
class AxisKind:
    """Units of an axis.

    Attributes:
        profile: MotionProfile: 1 rotary, 3 linear.
        position: UNECE code and name of the unit of its position.
        speed: Of its speed.
    """

    profile: int
    position: tuple[str, str]
    speed: tuple[str, str]


ROTARY = AxisKind(1, ("DD", "°"), ("E96", "°/s"))
LINEAR = AxisKind(3, ("MMT", "mm"), ("C16", "mm/s"))


class AddressSpace:
    """Nodes of one robot; `variables` has the changing ones by short names.

    Short names: position.0, speed.0, temperature.0 of each axis; mode, emergency_stop, protective_stop;
    override, in_control, on_path, mass; program, loaded, execution.
    """

    def __init__(self, server: Server) -> None:
        self._server = server
        self._types: dict[str, Node] = {}
        self._robotics = self._devices = self._own = 0
        self.variables: dict[str, Node] = {}

    async def build(self, name: str, model: str, axes: Sequence[AxisKind]) -> None:
        """Make the nodes.

        Args:
            name: Of the motion device.
        """
        self._robotics = await self._server.register_namespace(ROBOTICS)
        self._devices = await self._server.register_namespace(DEVICES)
        self._own = await self._server.register_namespace(INSTANCES)
        for type_name, number in _TYPES.items():
            self._types[type_name] = await self._type(type_name, number, self._robotics)
        self._types["SoftwareType"] = await self._type("SoftwareType", _SOFTWARE_TYPE, self._devices)
        moves = await self._server.get_node(ua.NodeId(32, 0)).add_reference_type(
            ua.NodeId(_MOVES, self._robotics), ua.QualifiedName("Moves", self._robotics)
        )
        device_set = await self._server.nodes.objects.add_object(
            ua.NodeId(_DEVICE_SET, self._devices), ua.QualifiedName("DeviceSet", self._devices)
        )
        system = await self._object(device_set, "RobotSystem", "MotionDeviceSystemType", self._own)
        device = await self._object(
            await self._folder(system, "MotionDevices"), name, "MotionDeviceType", self._own
        )
        await self._identity(device, model)
        await self._value(device, "MotionDeviceCategory", _ARTICULATED_ROBOT, ua.VariantType.Int32)
        parameters = await self._parameters(device)
        await self._variable("override", parameters, "SpeedOverride", 100.0, ua.VariantType.Double)
        await self._variable("in_control", parameters, "InControl", True, ua.VariantType.Boolean)
        await self._variable("on_path", parameters, "OnPath", True, ua.VariantType.Boolean)
        load = await self._object(device, "FlangeLoad", "LoadType", self._robotics)
        await self._variable("mass", load, "Mass", 2.5, ua.VariantType.Double, ("KGM", "kg"))
        axis_folder, train_folder = (
            await self._folder(device, "Axes"),
            await self._folder(device, "PowerTrains"),
        )
        for number, kind in enumerate(axes):
            axis = await self._axis(axis_folder, number, kind)
            await self._power_train(train_folder, number, axis, moves)
        await self._safety(system)
        await self._controller(system, model)

    async def _axis(self, folder: Node, number: int, kind: AxisKind) -> Node:
        axis = await self._object(folder, f"Axis_{number + 1}", "AxisType", self._own)
        await self._value(axis, "MotionProfile", kind.profile, ua.VariantType.Int32)
        parameters = await self._parameters(axis)
        double = ua.VariantType.Double
        await self._variable(f"position.{number}", parameters, "ActualPosition", 0.0, double, kind.position)
        await self._variable(f"speed.{number}", parameters, "ActualSpeed", 0.0, double, kind.speed)
        return axis

    async def _power_train(self, folder: Node, number: int, axis: Node, moves: Node) -> None:
        train = await self._object(folder, f"PowerTrain_{number + 1}", "PowerTrainType", self._own)
        await train.add_reference(axis, moves, forward=True, bidirectional=False)
        motor = await self._object(train, "Motor", "MotorType", self._own)
        parameters = await self._parameters(motor)
        await self._variable(
            f"temperature.{number}",
            parameters,
            "MotorTemperature",
            30.0,
            ua.VariantType.Double,
            ("CEL", "°C"),
        )

    async def _safety(self, system: Node) -> None:
        safety = await self._object(
            await self._folder(system, "SafetyStates"), "SafetyState", "SafetyStateType", self._own
        )
        parameters = await self._parameters(safety)
        await self._variable("mode", parameters, "OperationalMode", 4, ua.VariantType.Int32)
        for short, name in (("emergency_stop", "EmergencyStop"), ("protective_stop", "ProtectiveStop")):
            await self._variable(short, parameters, name, False, ua.VariantType.Boolean)

    async def _controller(self, system: Node, model: str) -> None:
        controller = await self._object(
            await self._folder(system, "Controllers"), "Controller", "ControllerType", self._own
        )
        await self._identity(controller, model)
        software = await self._object(
            await self._folder(controller, "Software"), "System", "SoftwareType", self._own
        )
        await self._value(software, "SoftwareRevision", "SIM 1.0", ua.VariantType.String, self._devices)
        task = await self._object(
            await self._folder(controller, "TaskControls"), "Task_1", "TaskControlType", self._own
        )
        parameters = await self._parameters(task)
        await self._variable("program", parameters, "TaskProgramName", "", ua.VariantType.String)
        await self._variable("loaded", parameters, "TaskProgramLoaded", False, ua.VariantType.Boolean)
        await self._variable("execution", parameters, "ExecutionMode", 1, ua.VariantType.Int32)

    async def _identity(self, node: Node, model: str) -> None:
        text = ua.VariantType.LocalizedText
        await self._value(node, "Manufacturer", ua.LocalizedText("robomesh (simulated)"), text, self._devices)
        await self._value(node, "Model", ua.LocalizedText(model), text, self._devices)
        await self._value(node, "ProductCode", "-", ua.VariantType.String, self._devices)
        await self._value(node, "SerialNumber", "0", ua.VariantType.String, self._devices)

    # --------------------------------------------------------------------------- nodes

    async def _type(self, name: str, number: int, namespace: int) -> Node:
        base = self._server.nodes.base_object_type
        return await base.add_object_type(ua.NodeId(number, namespace), ua.QualifiedName(name, namespace))

    async def _object(self, parent: Node, name: str, type_: str, namespace: int) -> Node:
        return await parent.add_object(
            ua.NodeId(0, self._own),
            ua.QualifiedName(name, namespace),
            objecttype=self._types[type_].nodeid,
            instantiate_optional=False,
        )

    async def _folder(self, parent: Node, name: str) -> Node:
        return await parent.add_folder(ua.NodeId(0, self._own), ua.QualifiedName(name, self._robotics))

    async def _parameters(self, parent: Node) -> Node:
        return await parent.add_object(
            ua.NodeId(0, self._own), ua.QualifiedName("ParameterSet", self._devices)
        )

    async def _value(
        self, parent: Node, name: str, value: object, type_: ua.VariantType, namespace: int | None = None
    ) -> None:
        """Add a property with a constant value."""
        at = self._robotics if namespace is None else namespace
        await parent.add_property(ua.NodeId(0, self._own), ua.QualifiedName(name, at), value, type_)

    async def _variable(
        self,
        short: str,
        parent: Node,
        name: str,
        value: object,
        type_: ua.VariantType,
        unit: tuple[str, str] | None = None,
    ) -> None:
        """Add a variable; its NodeId is its short name."""
        variable = await parent.add_variable(
            ua.NodeId(short, self._own), ua.QualifiedName(name, self._robotics), value, type_
        )
        if unit is not None:
            code, text = unit
            stated = ua.EUInformation(
                NamespaceUri=_UNECE,
                UnitId=int.from_bytes(code.encode(), "big"),
                DisplayName=ua.LocalizedText(text),
            )
            await variable.add_property(
                ua.NodeId(0, self._own), ua.QualifiedName("EngineeringUnits", 0), stated
            )
        self.variables[short] = variable
