"""One picture from a robot's state and a requested view: composition, texts, lines, encoded result.

Also a robot's four views, for the command line. No topics, and nothing that decides when to draw (`service`).
"""
