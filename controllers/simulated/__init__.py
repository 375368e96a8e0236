"""What simulated controllers share: faults, their schedule and requests, and the demo.

The protocol of a simulated controller belongs to its kind.
"""
