"""Kinds of FANUC controllers: reading by SNPX, and what FTP and RMI share with it; all without I/O."""

from protocol_gateway.seam.kind import Kind

SNPX = Kind(
    driver="controllers.fanuc.rmi.motion_driver:fanuc_driver",
    key="fanuc",
    table="controllers.fanuc.table:Fanuc",
    probe="controllers.fanuc.probe:SNPX",
    simulated="controllers.fanuc.simulated.start:SNPX",
)
FTP = Kind(
    driver="controllers.fanuc.ftp.driver:fanuc_ftp_driver",
    key="fanuc",
    table="controllers.fanuc.table:Fanuc",
    probe="controllers.fanuc.probe:FTP",
    simulated="controllers.fanuc.simulated.start:FTP",
)
