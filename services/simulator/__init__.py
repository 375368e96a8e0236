"""A simulated controller of the paper's kind: a TCP server that moves any described arm, outside the mesh."""
