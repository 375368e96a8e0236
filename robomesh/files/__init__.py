"""Files and processes: atomic writes, workers with a limit of memory, forks. Nothing of the mesh."""
