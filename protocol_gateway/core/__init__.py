"""The unit protocol (Chen, Zhang, Xue 2001, section 4) without I/O: bytes in, units out, and back."""
