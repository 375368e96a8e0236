"""What the gateway publishes of a robot: joints, state, signals, events.

No commands: `control` executes them.
"""
