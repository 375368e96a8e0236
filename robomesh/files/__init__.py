"""Files and processes of this machine: atomic writes, workers with limits, forks; nothing of the mesh."""
