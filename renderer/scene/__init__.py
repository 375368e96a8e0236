"""What stands where, as plain data: appearances, placements, cameras, parts of a scene.

No OpenGL (`drawing`) and no preparation of triangles (`shapes`).
"""
