"""The console's HTTP routes and connections."""
