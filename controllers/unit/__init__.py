"""The gateway's own unit protocol, and its simulated controller."""

from protocol_gateway.seam.kind import Kind

UNIT = Kind(
    driver="controllers.unit.driver:UnitDriver",
    key="",
    probe="controllers.unit.probe:UNIT",
    simulated="controllers.unit.simulated.start:UNIT",
)
