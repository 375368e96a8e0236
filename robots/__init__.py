"""Robot descriptions, D-H rows, shapes, kinematics, collision checks, URDF and GLB."""
