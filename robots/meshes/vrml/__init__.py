"""VRML 2.0 (VRML97): reading what it draws, and writing it. Source: ISO/IEC 14772-1:1997."""
