"""Reader and writer of 3DS, the files of 3D Studio: shapes, materials and hierarchy."""
