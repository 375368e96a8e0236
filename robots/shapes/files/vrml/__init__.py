"""Reader and writer of VRML 2.0 (VRML97). Source: ISO/IEC 14772-1:1997."""
