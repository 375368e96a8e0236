"""Programs that measure the mesh: fan-out, Python clients, linked sites, lines over a wide area."""
