"""Rules of authority over a robot: leases, stops, preconditions. Pure functions; time is an argument."""
