"""Everything about a robot that needs no network: description, shapes, kinematics, collisions, programs, checks.

No session, no controller and no picture.
"""
