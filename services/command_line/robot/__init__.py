"""`robomesh robot`, `fk` and `ik`: descriptions and kinematics, without a running mesh."""
