"""Mesh files to triangles and back: VRML 2.0 and 3DS, read and written here."""
