"""Programs that measure kinematics, checks of collisions, and the reading of meshes."""
