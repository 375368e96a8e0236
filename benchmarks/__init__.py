"""Measurements compared with peers; `python -m benchmarks` lists the programs, `run_all` starts many."""
