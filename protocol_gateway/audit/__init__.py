"""The audit log: what was asked of a robot, by whom, and what became of it."""
