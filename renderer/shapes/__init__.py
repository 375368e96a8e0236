"""Preparation of received GLB files for drawing: normals, edges, levels of detail, their cache.

Reading files belongs to `robots.shapes.files`.
"""
