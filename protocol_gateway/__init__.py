"""The gateway between a controller's legacy protocol and the mesh: protocol core, drivers, link, authority, audit."""
