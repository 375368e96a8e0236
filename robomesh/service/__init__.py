"""A process of the mesh: it runs until a signal, and has presence, health, a clock and metrics."""
