"""Files that describe a robot: robot.toml, URDF, VRML and GLB, read, checked, imported and written.

Their geometry is read by `shapes.files`.
"""
