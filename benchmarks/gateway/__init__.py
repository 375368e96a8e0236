"""Programs that measure the gateway: units, stops, control, faults, kinds of controllers."""
