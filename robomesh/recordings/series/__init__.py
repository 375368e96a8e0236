"""Values over time from the messages of a recording: by name, on one time axis, downsampled, as a table."""
