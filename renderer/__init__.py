"""Pictures of the mesh's robots, off screen: scene, cameras, OpenGL, overlay, encoders, and the service.

It learns robots only from the mesh, and draws only what somebody watches.
"""
