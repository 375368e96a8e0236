"""What simulated controllers share: faults, their schedule and requests, and the demo."""
