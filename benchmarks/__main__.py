"""Run a program: `python -m benchmarks NAME [OPTIONS]`; without a name, list the programs."""

import multiprocessing
import sys

from benchmarks.harness.program import main

if __name__ == "__main__":
    # A fork of a process with a Zenoh session hangs.
    multiprocessing.set_start_method("spawn")
    main(sys.argv[1:])
