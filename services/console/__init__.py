"""The console: serves the page, and connects browsers to the mesh."""
