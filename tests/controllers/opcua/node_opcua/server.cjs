// An OPC UA server that node-opcua makes from its own nodesets: `node server.cjs PORT FOLDER`.
const { OPCUAServer } = require("node-opcua-server");
const { OPCUACertificateManager } = require("node-opcua-certificate-manager");
const { nodesets } = require("node-opcua-nodesets");
const { DataType } = require("node-opcua-variant");
const { StatusCodes } = require("node-opcua-status-code");
const { standardUnits } = require("node-opcua-data-access");

const [, , port, folder] = process.argv;

async function main() {
  const serverCertificateManager = new OPCUACertificateManager({
    rootFolder: `${folder}/pki`,
    automaticallyAcceptUnknownCertificate: true,
  });
  await serverCertificateManager.initialize();
  const server = new OPCUAServer({
    port: Number(port),
    resourcePath: "/UA/Robot",
    serverCertificateManager,
    nodeset_filename: [nodesets.standard, nodesets.di, nodesets.ia, nodesets.robotics],
    userManager: { isValidUser: (user, password) => user === "monitor" && password === "secret" },
  });
  await server.initialize();
  const space = server.engine.addressSpace;
  const robotics = space.getNamespaceIndex("http://opcfoundation.org/UA/Robotics/");
  const devices = space.getNamespaceIndex("http://opcfoundation.org/UA/DI/");
  const instance = (type, browseName, componentOf, optionals = []) =>
    space.findObjectType(type, robotics).instantiate({ browseName, componentOf, optionals });
  const child = (node, ...names) => names.reduce((at, name) => at.getChildByName(name), node);
  const set = (node, dataType, value) => node.setValueFromSource({ dataType, value });

  const system = instance("MotionDeviceSystemType", "Line", space.findNode(`ns=${devices};i=5001`));
  const device = instance("MotionDeviceType", "R1", child(system, "MotionDevices"));
  set(child(device, "ParameterSet", "SpeedOverride"), DataType.Double, 55);
  const positions = [1, 2, 3, 4, 5, 6].map((number) => {
    const axis = instance("AxisType", `Axis_${number}`, child(device, "Axes"));
    set(child(axis, "MotionProfile"), DataType.Int32, 1);
    const position = child(axis, "ParameterSet", "ActualPosition");
    set(child(position, "EngineeringUnits"), DataType.ExtensionObject, standardUnits.degree);
    return position;
  });
  const safety = child(instance("SafetyStateType", "Safety", child(system, "SafetyStates")), "ParameterSet");
  set(child(safety, "OperationalMode"), DataType.Int32, 4);
  set(child(safety, "EmergencyStop"), DataType.Boolean, false);
  set(child(safety, "ProtectiveStop"), DataType.Boolean, false);

  const counts = {};
  server.on("request", (request) => {
    counts[request.constructor.name] = (counts[request.constructor.name] || 0) + 1;
  });
  let turn = 0;
  setInterval(() => {
    turn += 0.02;
    const now = new Date();
    positions.forEach((position, axis) => {
      position.setValueFromSource(
        { dataType: DataType.Double, value: 30 * Math.sin(turn) + axis },
        StatusCodes.Good,
        now,
      );
    });
  }, 20);
  await server.start();
  console.log("ready");
  process.stdin.on("end", async () => {
    console.log(JSON.stringify(counts));
    await server.shutdown(100);
    process.exit(0);
  });
  process.stdin.resume();
}

main().catch((error) => {
  console.error(error);
  process.exit(1);
});
