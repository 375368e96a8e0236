"""Length limits for texts of operators and controllers that the gateway publishes and logs."""

from robomesh.texts import one_line

__all__ = ["LONGEST", "LONGEST_SENTENCE", "one_line"]

LONGEST = 200
"""Most characters of an operator's or a controller's text."""

LONGEST_SENTENCE = 800
"""Most characters of the gateway's own sentence, which may contain several of these texts."""
