"""Mesh files: readers and writers of VRML 2.0, 3DS, DXF, STEP, STL, OBJ, PLY, COLLADA and glTF."""
