"""Off-screen rendering of the mesh's robots: scene, cameras, OpenGL, overlay, encoders, and the service.

Robots are known only from the mesh, and only views with subscribers are drawn.
"""
