"""Server for old client programs, which connect to the gateway as if it were the controller."""
