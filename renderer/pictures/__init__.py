"""One picture from a robot's state and a requested view: composition, texts, lines, encoded result.

No time-table and no topics (`streams`).
"""
