"""Encoding of pixels: H.264, JPEG, and the container of a video.

No robots and no views.
"""
