"""Kind of Universal Robots controllers: drivers that read and move, signals, settings; without I/O."""

from protocol_gateway.seam.kind import Kind

RTDE = Kind(
    driver="controllers.universal_robots.motion_driver:rtde_driver",
    key="universal_robots",
    table="controllers.universal_robots.table:UniversalRobots",
    probe="controllers.universal_robots.probe:RTDE",
    simulated="controllers.universal_robots.simulated.start:RTDE",
)
