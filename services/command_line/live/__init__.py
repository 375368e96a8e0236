"""The commands that attach to a running mesh: list, monitor, send, fault, snapshot, video, alive."""
