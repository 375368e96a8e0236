"""`robomesh robot`, `shapes`, `fk` and `ik`: descriptions and kinematics, without a running mesh."""
