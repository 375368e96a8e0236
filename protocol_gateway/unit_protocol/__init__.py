"""Unit protocol (Chen, Zhang, Xue 2001, section 4) without I/O: parser and formatter.

Its driver belongs to `controllers.unit`.
"""
