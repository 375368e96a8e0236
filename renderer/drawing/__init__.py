"""OpenGL: contexts, shaders, shadows, levels of detail; from a scene and a camera to an array of pixels.

The only room that imports moderngl; texts are written in `pictures`.
"""
