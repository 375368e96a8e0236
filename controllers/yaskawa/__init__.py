"""High-Speed Ethernet Server of Yaskawa's controllers (HSES), without I/O."""

from protocol_gateway.seam.kind import Kind

HSES = Kind(
    driver="controllers.yaskawa.motion_driver:hses_driver",
    key="yaskawa",
    table="controllers.yaskawa.table:Yaskawa",
    datagrams=True,
    probe="controllers.yaskawa.probe:HSES",
    simulated="controllers.yaskawa.simulated.start:HSES",
)
