"""All about a robot that needs no network: descriptions, shapes, kinematics, collisions, programs, checks.

No session, no controller and no picture.
"""
