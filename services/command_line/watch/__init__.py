"""Commands that read a running mesh: list, monitor, signals, pictures, video, alarms. None moves an arm."""
