"""Clients of the mesh for Python programs: `import robomesh` exports what is public here."""
