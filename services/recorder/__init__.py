"""Recorder service: captures of topics as self-contained MCAP files. `reading/` reads what is recorded."""
