"""Memory limit of a process that reads files or computes for long."""

import resource

MEMORY_BYTES = 6 * 1024**3


def limit_memory(most_bytes: int = MEMORY_BYTES) -> None:
    """Limit this process's memory; a larger allocation raises MemoryError. A smaller existing limit stays."""
    # RLIMIT_AS would also count the code of libraries, and files that are only mapped.
    _, hard = resource.getrlimit(resource.RLIMIT_DATA)
    most = most_bytes if hard == resource.RLIM_INFINITY else min(most_bytes, hard)
    resource.setrlimit(resource.RLIMIT_DATA, (most, most))
