"""Commands for teach programs: check and plan them, and read those that the store keeps."""
