"""The process that answers long requests: checks of programs, inverse kinematics. No session."""
