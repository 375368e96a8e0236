"""Length limits of texts that the gateway publishes and logs."""

LONGEST_TEXT = 200
"""Most characters of an operator's or a controller's text."""

LONGEST_SENTENCE = 800
"""Most characters of the gateway's own sentence, which may contain several of these texts."""
