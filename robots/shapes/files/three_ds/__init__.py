"""Reader and writer of 3DS, the files of 3D Studio: shapes, materials and hierarchy.

No robot and no unit: 3DS states neither.
"""
