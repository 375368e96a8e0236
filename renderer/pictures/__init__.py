"""One picture from a robot's state and a requested view: composition, texts, lines, encoded result; four views of a robot.

No topics, and nothing that decides when to draw (`service`).
"""
