"""One TCP client of whoever serves units, a controller or the gateway, and its limits."""
