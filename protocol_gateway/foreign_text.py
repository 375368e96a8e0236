"""Texts of others, as the gateway shows them, publishes them and writes them down."""

from robomesh.texts import one_line

__all__ = ["LONGEST", "LONGEST_SENTENCE", "one_line"]

LONGEST = 200
"""Characters of an operator's or a controller's text."""

LONGEST_SENTENCE = 800
"""Characters of what the gateway says; it holds several such texts at most."""
