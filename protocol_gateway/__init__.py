"""Gateway between controllers and the mesh: protocol core, drivers, link, authority, audit log."""
