"""What the gateway publishes of a robot: joints, state, signals, events; and the confirmed tool.

No commands: they belong to `execution`.
"""
