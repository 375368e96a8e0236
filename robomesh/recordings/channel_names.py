"""Names in recordings, and endings of their files."""

from robomesh.errors import KeyNameError
from robomesh.keys import parse_key

# Metadata records: description of the recording; numbers of missing publications by topic.
ABOUT = "robomesh"
LOST = "robomesh.lost"
# Endings: of a recording, and of one that is being rewritten.
SUFFIX = ".mcap"
INDEXING = ".indexing"


def topic_name(channel: str) -> str:
    """Return a channel's topic below its robot: "joints"; of another program's channel, its whole name."""
    try:
        return parse_key(channel).topic
    except KeyNameError:
        return channel.strip("/")
