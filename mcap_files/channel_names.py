"""Names of ours in and of recordings."""

# Metadata records: what a recording is; publications that are not in it, by topic.
ABOUT = "robomesh"
LOST = "robomesh.lost"
# Endings: of a recording, and of one that is being written again.
SUFFIX = ".mcap"
INDEXING = ".indexing"
