"""Between a controller and the mesh: protocol core, drivers, link, authority, audit, gateway."""
