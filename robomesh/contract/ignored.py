"""Messages on keys that fit no key of the contract: ignored, counted, and kept as examples.

Without certificates any program can publish, answer, query and declare presence on any key that Zenoh
accepts. One malformed name must not end a service or hide other names, so every key received from the mesh
is checked here and only here. A process's health reports the count and the examples; the watch makes an
event of each example.
"""

import threading

from robomesh.contract import keys
from robomesh.contract.access_rights import PROBE_ROBOT
from robomesh.errors import KeyNameError
from robomesh.texts import one_line

# Examples that a process keeps, and the longest part of a key that each shows.
MOST_EXAMPLES = 16
LONGEST_EXAMPLE = 160

TOKEN, PUBLICATION, REPLY, REQUEST = "liveliness token", "publication", "reply", "request"


class Ignored:
    """The keys that a session has ignored. Safe to use from any thread.

    Attributes:
        count: Number of ignored tokens, publications, replies and requests.
        examples: The first distinct ones as text for people: kind and key.
    """

    def __init__(self) -> None:
        self.count = 0
        self.examples: dict[str, None] = {}
        self._lock = threading.Lock()

    def key(self, kind: str, text: str) -> keys.Key | None:
        """Return the parts of a received key; None: the key is invalid and is ignored."""
        try:
            return keys.parse_key(text)
        except KeyNameError:
            self.note(kind, text)
            return None

    def presence(self, text: str) -> keys.PresenceKey | None:
        """Return the parts of a liveliness token's key; None: the key is invalid and is ignored."""
        try:
            return keys.parse_presence_key(text)
        except KeyNameError:
            self.note(TOKEN, text)
            return None

    def note(self, kind: str, text: str) -> None:
        """Count an ignored message, unless `doctor --security` has probed the rules with it."""
        if f"/{PROBE_ROBOT}$*/" in text:
            return
        with self._lock:
            self.count += 1
            if len(self.examples) < MOST_EXAMPLES:
                self.examples[f"{kind} {one_line(text, LONGEST_EXAMPLE)}"] = None
