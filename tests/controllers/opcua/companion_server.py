"""An OPC UA server made by asyncua from the OPC Foundation's own nodeset of OPC 40010-1.

Its objects are instances of the nodeset's types as asyncua makes them; a test sets values only. Every request
that arrives is counted by its service.
"""

import contextlib
import logging
import lzma
from collections import Counter
from datetime import UTC, datetime
from pathlib import Path

from asyncua import Server, ua
from asyncua.server.uaprocessor import UaProcessor

from controllers.opcua.reader import discovery as ids
from controllers.opcua.units import UNECE, number_of
from tests.controllers.opcua.standard_nodes import keep_standard_nodes

NODESETS = Path(__file__).parent / "companion"
NODESET_FILES = ("Opc.Ua.Di.NodeSet2.xml.xz", "Opc.Ua.Robotics.NodeSet2.xml.xz")
DEGREES = ("DD", "°")
KINDS = {
    bool: ua.VariantType.Boolean,
    int: ua.VariantType.Int32,
    float: ua.VariantType.Double,
    str: ua.VariantType.String,
}


class Companion:
    """The server's objects.

    Attributes:
        counts: Requests by their service.
        nodes: Variables by a short name: "position.1", "mode", ...
    """

    def __init__(self, server, port):
        self.server, self.port = server, port
        self.counts = Counter()
        self.nodes = {}

    async def set(self, name, value, *, at=None, status=ua.StatusCodes.Good):
        """Set a variable's value as of a time."""
        node = self.nodes[name]
        kind = KINDS[type(value)]
        data = ua.DataValue(
            ua.Variant(value, kind), ua.StatusCode(status), SourceTimestamp=at or datetime.now(UTC)
        )
        await self.server.iserver.write_attribute_value(node.nodeid, data)

    async def set_positions(self, degrees, *, at=None):
        at = at or datetime.now(UTC)
        for number, value in enumerate(degrees, 1):
            await self.set(f"position.{number}", float(value), at=at)


@contextlib.asynccontextmanager
async def companion_server(axes=6, unit=DEGREES, security=None, users=None, devices=("Arm",), speeds=False):
    """Run the server with one motion device a name, and yield its first.

    Args:
        unit: Code and name of the axes' EngineeringUnits; None: they have none.
        security: Function that is called with the server before it starts.
        users: The server's user manager.
    """
    for logger in ("asyncua", "asyncua.common.xmlimporter"):
        logging.getLogger(logger).setLevel(logging.CRITICAL)
    keep_standard_nodes()
    server = Server(user_manager=users) if users else Server()
    await server.init()
    server.set_endpoint("opc.tcp://127.0.0.1:0/cell")
    if security is None:
        server.set_security_policy([ua.SecurityPolicyType.NoSecurity])
    else:
        await security(server)
    for name in NODESET_FILES:
        nodeset = lzma.decompress((NODESETS / name).read_bytes()).decode()
        await server.import_xml(xmlstring=nodeset)
    robotics = await server.get_namespace_index(ids.ROBOTICS)
    companion = Companion(server, 0)
    builder = _Builder(server, robotics, companion.nodes)
    await builder.system(devices, axes, unit, speeds)
    with _counted(companion.counts):
        async with server:
            port = server.bserver._server.sockets[0].getsockname()[1]
            companion.port = port
            yield companion


@contextlib.contextmanager
def _counted(counts):
    """Count each request by the name of its service."""
    before = UaProcessor.process_message

    async def process(self, seqhdr, body):
        type_ = ua.ua_binary.nodeid_from_binary(body.copy())
        name = ua.ObjectIdNames.get(type_.Identifier, str(type_))
        counts[name.removesuffix("_Encoding_DefaultBinary")] += 1
        return await before(self, seqhdr, body)

    UaProcessor.process_message = process
    try:
        yield
    finally:
        UaProcessor.process_message = before


class _Builder:
    def __init__(self, server, robotics, nodes):
        self.server, self.index, self.nodes = server, robotics, nodes

    def type(self, number):
        return self.server.get_node(ua.NodeId(number, self.index))

    async def add(self, parent, name, type_):
        return await parent.add_object(
            self.index, name, objecttype=self.type(type_).nodeid, instantiate_optional=True
        )

    async def child(self, node, *names):
        for name in names:
            children = {(await each.read_browse_name()).Name: each for each in await node.get_children()}
            node = children[name]
        return node

    async def put(self, short, node, value, variant):
        self.nodes[short] = node
        await node.write_value(ua.Variant(value, variant))

    async def system(self, devices, axes, unit, speeds):
        device_set = await self.child(self.server.nodes.objects, "DeviceSet")
        system = await self.add(device_set, "Cell", ids.SYSTEM)
        folder = await self.child(system, "MotionDevices")
        for name in devices:
            await self.device(await self.add(folder, name, ids.DEVICE), axes, unit, speeds)
        safety = await self.add(await self.child(system, "SafetyStates"), "Safety", ids.SAFETY)
        parameters = await self.child(safety, "ParameterSet")
        for short, name, value, variant in (
            ("mode", "OperationalMode", 4, ua.VariantType.Int32),
            ("emergency_stop", "EmergencyStop", False, ua.VariantType.Boolean),
            ("protective_stop", "ProtectiveStop", False, ua.VariantType.Boolean),
        ):
            await self.put(short, await self.child(parameters, name), value, variant)
        controller = await self.add(await self.child(system, "Controllers"), "Controller", ids.CONTROLLER)
        task = await self.add(await self.child(controller, "TaskControls"), "Main", ids.TASK)
        parameters = await self.child(task, "ParameterSet")
        for short, name, value, variant in (
            ("program", "TaskProgramName", "Weld", ua.VariantType.String),
            ("loaded", "TaskProgramLoaded", True, ua.VariantType.Boolean),
            ("execution", "ExecutionMode", 1, ua.VariantType.Int32),
        ):
            await self.put(short, await self.child(parameters, name), value, variant)

    async def device(self, device, axes, unit, speeds):
        for name, value in (("Manufacturer", "Somebody"), ("Model", "R6"), ("SerialNumber", "17")):
            node = await self.child(device, name)
            kind = ua.VariantType.String if name == "SerialNumber" else ua.VariantType.LocalizedText
            await node.write_value(
                ua.Variant(value if kind is ua.VariantType.String else ua.LocalizedText(value), kind)
            )
        parameters = await self.child(device, "ParameterSet")
        for short, name, value, variant in (
            ("override", "SpeedOverride", 80.0, ua.VariantType.Double),
            ("in_control", "InControl", True, ua.VariantType.Boolean),
            ("on_path", "OnPath", True, ua.VariantType.Boolean),
        ):
            await self.put(short, await self.child(parameters, name), value, variant)
        await self.put("mass", await self.child(device, "FlangeLoad", "Mass"), 4.5, ua.VariantType.Double)
        await self.unit_of(self.nodes["mass"], ("KGM", "kg"))
        folder = await self.child(device, "Axes")
        for number in range(1, axes + 1):
            axis = await self.add(folder, f"Axis_{number}", ids.AXIS)
            await (await self.child(axis, "MotionProfile")).write_value(ua.Variant(1, ua.VariantType.Int32))
            position = await self.child(axis, "ParameterSet", "ActualPosition")
            await self.put(f"position.{number}", position, 0.0, ua.VariantType.Double)
            if unit is not None:
                await self.unit_of(position, unit)
            for name in ("ActualSpeed", "ActualAcceleration"):
                node = await self.child(axis, "ParameterSet", name)
                if name == "ActualSpeed" and speeds:
                    await self.put(f"speed.{number}", node, 0.0, ua.VariantType.Double)
                    await self.unit_of(node, ("E96", "°/s"))
                else:
                    await node.delete()

    async def unit_of(self, variable, unit):
        code, text = unit
        value = ua.EUInformation(
            NamespaceUri=UNECE, UnitId=number_of(code), DisplayName=ua.LocalizedText(text)
        )
        node = await self.child(variable, "EngineeringUnits")
        await node.write_value(ua.Variant(value, ua.VariantType.ExtensionObject))
