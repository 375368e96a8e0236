"""The process that reads an OPC UA server: only here the gateway's side imports `asyncua`."""
