"""Where an arm's links are: tree, joints, D-H rows, the solver's model, motion, and the comparison of joints.

No collisions, and no file of a robot.
"""
