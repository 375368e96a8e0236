"""Recorder service: captures of a robot's topics as self-contained MCAP files."""
