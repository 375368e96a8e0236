"""Bridge to Foxglove and Lichtblick: the mesh's robots on a WebSocket server of Foxglove's SDK."""
