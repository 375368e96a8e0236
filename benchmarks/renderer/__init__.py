"""Programs that measure pictures and video streams."""
