"""The project's tests."""

import os

# As `robomesh` does, for this process and its children; before they import NumPy.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# A terminal's wishes would colour the output that tests compare.
for _wish in ("FORCE_COLOR", "NO_COLOR", "CLICOLOR_FORCE"):
    os.environ.pop(_wish, None)
