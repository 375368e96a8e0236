"""Controllers' own protocols behind one seam: bytes in, what they tell out, and back."""
