"""SNPX of FANUC's controllers (memory of a GE PLC over TCP), read only, without I/O."""

from protocol_gateway.seam.kind import Kind

SNPX = Kind(
    driver="controllers.fanuc.motion_driver:fanuc_driver",
    key="fanuc",
    table="controllers.fanuc.table:Fanuc",
    probe="controllers.fanuc.probe:SNPX",
    simulated="controllers.fanuc.simulated.start:SNPX",
)
FTP = Kind(
    driver="controllers.fanuc.ftp_driver:fanuc_ftp_driver",
    key="fanuc",
    table="controllers.fanuc.table:Fanuc",
    probe="controllers.fanuc.probe:FTP",
    simulated="controllers.fanuc.simulated.start:FTP",
)
