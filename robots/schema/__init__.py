"""What a robot's files are made of: keys of robot.toml, units, poses, errors, and bounded TOML and XML.

No kinematics, and no reader of a format.
"""
