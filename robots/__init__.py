"""Robot descriptions, D-H rows, meshes, kinematics, collision checks, URDF and GLB."""
