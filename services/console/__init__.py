"""The console: serves the page, and connects browsers to the mesh. `app.py` joins its rooms."""
