"""The project's tests."""

import os

# As `robomesh` does, for this process and its children; before they import NumPy.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
