"""A folder a robot: its description and its meshes. To add one, see CONTRIBUTING."""
