"""What others send on keys that fit no key of the contract: ignored here, counted, and kept as examples.

Without certificates any program can put to, answer on, ask and be present on any key that Zenoh takes. One
odd name must not end a service or hide the others, so every key that comes from the mesh is checked here
and nowhere else. A process's health tells the count and the examples; the watch makes each an event.
"""

import threading

from robomesh import keys
from robomesh.errors import KeyNameError
from robomesh.texts import one_line

# Examples that a process keeps, and how much of a key each shows.
MOST_EXAMPLES = 16
LONGEST_EXAMPLE = 160

TOKEN, PUBLICATION, REPLY, REQUEST = "liveliness token", "publication", "reply", "request"


class Ignored:
    """The keys that a session has ignored. Safe to use from any thread.

    Attributes:
        count: How many tokens, publications, replies and requests were ignored.
        examples: The first different ones, as people may read them: kind and key.
    """

    def __init__(self) -> None:
        self.count = 0
        self.examples: dict[str, None] = {}
        self._lock = threading.Lock()

    def key(self, kind: str, text: str) -> keys.Key | None:
        """Return the parts of a key that came; None: it fits no key of the contract, and is ignored."""
        try:
            return keys.parse_key(text)
        except KeyNameError:
            self.note(kind, text)
            return None

    def presence(self, text: str) -> keys.PresenceKey | None:
        """Return the parts of a liveliness token's key; None: it is none of the contract, and is ignored."""
        try:
            return keys.parse_presence_key(text)
        except KeyNameError:
            self.note(TOKEN, text)
            return None

    def note(self, kind: str, text: str) -> None:
        """Count something that is ignored."""
        with self._lock:
            self.count += 1
            if len(self.examples) < MOST_EXAMPLES:
                self.examples[f"{kind} {one_line(text, LONGEST_EXAMPLE)}"] = None
