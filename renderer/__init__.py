"""Off-screen rendering of a site's robots, as video and pictures.

Robots are known only from the mesh, and only views with subscribers are drawn.
"""
