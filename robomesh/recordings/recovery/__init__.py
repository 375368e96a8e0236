"""Recovery of recordings that a crash cut off, and indexing of closed ones, by rewriting their files."""
