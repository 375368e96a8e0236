"""Error of a script."""


class ScriptError(Exception):
    """A script that cannot be compiled, or cannot go on.

    Args:
        line: Number of the line, from 1; 0: unknown.
    """

    def __init__(self, text: str, line: int = 0) -> None:
        super().__init__(text)
        self.text = text
        self.line = line
