"""What an arm is and can do: descriptions, D-H, meshes, kinematics, URDF and GLB."""
