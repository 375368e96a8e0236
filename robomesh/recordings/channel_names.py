"""Names in recordings, and endings of their files."""

# Metadata records: description of the recording; numbers of missing publications by topic.
ABOUT = "robomesh"
LOST = "robomesh.lost"
# Endings: of a recording, and of one that is being rewritten.
SUFFIX = ".mcap"
INDEXING = ".indexing"
