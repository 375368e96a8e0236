"""Files with geometry: readers and writers of VRML 2.0, 3DS, DXF, STEP, STL, OBJ, PLY, COLLADA and glTF.

No robot: a file that describes links and joints belongs to `descriptions`.
"""
