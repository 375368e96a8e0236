"""Reader and writer of URDF, with SRDF and the rules for finding the files that a URDF names.

The joints become a tree of `kinematics`; the shape files are read by `shapes.files`.
"""
