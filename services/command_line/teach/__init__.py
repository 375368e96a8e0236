"""Commands for teach programs: check and run, and the programs that the store keeps."""
