"""3DS, the files of 3D Studio: reading their meshes, materials and hierarchy, and writing them."""
