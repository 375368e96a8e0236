"""Reading of OPC UA servers: a separate process uses the library, and the driver decodes its output."""
