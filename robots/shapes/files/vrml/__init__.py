"""Reader and writer of VRML 2.0 (VRML97): text, nodes, PROTOs, and what they draw.

Joints in a VRML file belong to `descriptions.vrml_robot`. Source: ISO/IEC 14772-1:1997.
"""
