"""A recording as a table, plots, video or a file for Rerun."""
