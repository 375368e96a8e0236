"""Rules of authority over a robot: leases, stops, preconditions, and the decisions that follow from them.

Pure functions without I/O; time is an argument. `execution.control` performs the decisions.
"""
