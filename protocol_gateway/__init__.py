"""Gateway between controllers and the mesh: the service. Drivers belong to `controllers`."""
