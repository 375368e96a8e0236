"""One picture from a robot's state and a requested view: composition, texts, lines, encoded result.

No topics, and nothing that decides when to draw (`service`).
"""
