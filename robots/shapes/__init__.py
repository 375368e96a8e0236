"""Geometry: triangles, their normals and faces, and solids that are made from numbers.

No files (`files`), and nothing that moves (`kinematics`).
"""
