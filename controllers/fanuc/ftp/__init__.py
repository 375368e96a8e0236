"""Reading of a FANUC controller by FTP: commands, the files of its state, the driver. It moves nothing."""
