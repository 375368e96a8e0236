"""`robomesh robot`, `mesh`, `fk` and `ik`: descriptions and kinematics, without a running mesh."""
