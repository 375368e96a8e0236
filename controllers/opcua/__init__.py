"""Reading of OPC UA servers: a separate process uses the library, and the driver decodes its output."""

from protocol_gateway.seam.kind import Kind

OPCUA = Kind(
    driver="controllers.opcua.driver:OpcUaDriver",
    key="opcua",
    table="controllers.opcua.table:OpcUa",
    extra="opcua",
    packages=("asyncua",),
    certificate="controllers.opcua.certificate:make_own",
    probe="controllers.opcua.reader.probe:OPCUA",
    simulated="controllers.opcua.simulated.start:OPCUA",
)
