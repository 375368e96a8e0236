// A client of node-opcua reads our simulated controller, and tries to write it: `node client.cjs URL`.
const { OPCUAClient } = require("node-opcua-client");
const { AttributeIds } = require("node-opcua-data-model");
const { DataType } = require("node-opcua-variant");

async function main() {
  const client = OPCUAClient.create({ endpointMustExist: false });
  await client.connect(process.argv[2]);
  const session = await client.createSession();
  const namespaces = await session.readNamespaceArray();
  const own = namespaces.indexOf("urn:robomesh:simulated:robot");
  const devices = namespaces.indexOf("http://opcfoundation.org/UA/DI/");
  const position = { nodeId: `ns=${own};s=position.0`, attributeId: AttributeIds.Value };
  const value = await session.read(position);
  const browsed = await session.browse(`ns=${devices};i=5001`);
  const written = await session.write({
    ...position,
    value: { value: { dataType: DataType.Double, value: 1 } },
  });
  const subscription = await session.createSubscription2({
    requestedPublishingInterval: 50,
    requestedMaxKeepAliveCount: 6,
    requestedLifetimeCount: 100,
    publishingEnabled: true,
  });
  const item = await subscription.monitor(position, { samplingInterval: 50, queueSize: 1 }, 2);
  await new Promise((resolve) => {
    let changes = 0;
    item.on("changed", () => {
      changes += 1;
      if (changes === 10) resolve();
    });
  });
  console.log(
    JSON.stringify({
      status: value.statusCode.name,
      position: value.value.value,
      systems: browsed.references.map((each) => each.browseName.name),
      written: written.name,
    }),
  );
  await session.close();
  await client.disconnect();
}

main().catch((error) => {
  console.error(error);
  process.exit(1);
});
