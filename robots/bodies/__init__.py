"""The bodies of one arm: their geometry for coal, and which pairs of its links are checked.

Other arms, fixtures and the floor belong to `collision`.
"""
