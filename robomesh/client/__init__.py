"""Clients of the mesh for Python programs: `import robomesh` exports what is public here.

A connection, the mesh and the blocking forms; one robot is in `robot`, recordings are in `recordings`.
"""
