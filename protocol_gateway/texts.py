"""Texts of others, as the gateway shows them, publishes them and writes them down."""

LONGEST = 200
"""Characters of an operator's or a controller's text."""

LONGEST_SENTENCE = 800
"""Characters of what the gateway says; it holds several such texts at most."""


def one_line(text: str, longest: int = LONGEST) -> str:
    """A text on one line: cut when long, blanks for what moves a cursor, colours or hides."""
    # Cut before anything else is done: who sends megabytes is not to be worked for.
    cut = text[: longest + 1]
    plain = "".join(c if c.isprintable() else " " for c in cut)
    return plain if len(plain) <= longest else plain[: longest - 1] + "…"
