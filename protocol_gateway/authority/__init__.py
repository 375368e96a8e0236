"""Who may move a robot, and what forbids it: pure rules, time is an argument."""
