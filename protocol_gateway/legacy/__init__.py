"""Old client programs, which attach to the gateway as if it were the controller."""
