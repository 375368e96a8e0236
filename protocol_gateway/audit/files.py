"""Files of one robot's audit log: <robot>.jsonl is live, <robot>.<first number>.jsonl are older parts.

Older parts may have been moved to an archive: the chain is then verified from the first entry that is still
there, and the number of the others is reported. A gap anywhere else is a break.
"""

import fcntl
import glob
import os
import re
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from protocol_gateway.authority.audit_entry import NO_PREVIOUS, ChainLink, Entry, chain_link, parse_line
from protocol_gateway.persistence.persisted_state import starts_file
from protocol_gateway.seam.errors import AuditError

# Longer than every entry: a file with one endless line must not fill the reader's memory.
LONGEST_LINE = 1 << 20
_PART = re.compile(r"(.+)\.(\d{9,18})\.jsonl")


@dataclass(frozen=True, kw_only=True)
class Verification:
    """Result of a log's verification.

    Attributes:
        entries: Number of intact entries.
        first_break: Number of the first entry that was changed or is missing; None: none.
        first: Number of the first entry in the files; above 1 if older parts were moved away.
        last_hash: Hash of the last intact entry.
    """

    ok: bool
    entries: int
    first_break: int | None
    text: str
    first: int = 1
    last_hash: str = NO_PREVIOUS


def part_name(live: Path, first: int) -> Path:
    """Return the path of an older part of a log, by the number of its first entry."""
    return live.with_name(f"{live.stem}.{first:09d}.jsonl")


def first_number(part: Path) -> int:
    """Return the number of an older part's first entry, from its name."""
    matched = _PART.fullmatch(part.name)
    return int(matched[2]) if matched is not None else 0


def older_parts(live: Path) -> list[Path]:
    """Return the older parts of a log's live file, oldest first; none for an older part."""
    if _PART.fullmatch(live.name):
        return []
    found = []
    for path in live.parent.glob(f"{glob.escape(live.stem)}.*.jsonl"):
        matched = _PART.fullmatch(path.name)
        if matched is not None and matched[1] == live.stem:
            found.append(path)
    return sorted(found, key=first_number)


def open_files(live: Path, *, newest_first: bool = False) -> Iterator[BinaryIO]:
    """Yield every file of a log, opened one after the other.

    Raises:
        OSError: If the live file cannot be read.
    """
    with ExitStack() as stack:
        # Open the live file first: if the log is rotated now, this file becomes the newest part.
        newest = stack.enter_context(live.open("rb"))
        own = os.fstat(newest.fileno())
        parts = [part for part in older_parts(live) if not os.path.samestat(part.stat(), own)]
        if newest_first:
            yield newest
        for part in reversed(parts) if newest_first else parts:
            with part.open("rb") as file:
                yield file
        if not newest_first:
            yield newest


def lines_of(file: BinaryIO) -> Iterator[bytes]:
    """Yield the lines of a file; a line that is too long for an entry without its middle."""
    while line := file.readline(LONGEST_LINE):
        piece = line
        while len(piece) == LONGEST_LINE and not piece.endswith(b"\n"):
            piece = file.readline(LONGEST_LINE)
        yield line if piece is line else line[:-1] + piece[-1:]


def read_entries(live: Path) -> Iterator[Entry]:
    """Yield every readable entry of a log, oldest first; none without a file."""
    if not live.exists():
        return
    for file in open_files(live):
        for line in lines_of(file):
            try:
                yield parse_line(line)
            except AuditError:
                continue  # `verify` reports it; a search goes on


def verify(live: Path, head: str | None = None) -> Verification:
    """Verify a log's chain, and that it still holds the entry with the hash `head`.

    Args:
        live: The live file, which is verified with its older parts; or a single older part.

    Raises:
        OSError: If a file cannot be read.
    """
    last: ChainLink | None = None
    first, found = 1, head is None
    for file in open_files(live):
        for line in lines_of(file):
            link = chain_link(line)
            if last is None and link is not None and link.number > 1 and starts_file(line):
                first, last = link.number, ChainLink(link.number - 1, link.previous, link.previous, True)
            number, previous = (last.number + 1, last.hash) if last else (1, NO_PREVIOUS)
            if link is None and not line.endswith(b"\n") and _is_being_written(file):
                break
            problem = _problem(line, link, number, previous)
            if problem or link is None:
                return Verification(
                    ok=False, entries=number - first, first_break=number, text=problem, first=first
                )
            last = link
            found = found or link.hash == head
    number, last_hash = (last.number, last.hash) if last else (0, NO_PREVIOUS)
    entries = number - first + 1
    missing = f"; entries 1 to {first - 1} are not here" if first > 1 else ""
    if not found:
        return Verification(
            ok=False,
            entries=entries,
            first_break=number + 1,
            text=f"the log ends after entry {number}, but no entry has the hash {head}{missing}",
            first=first,
            last_hash=last_hash,
        )
    text = f"{entries} entries, unbroken{missing}"
    return Verification(
        ok=True, entries=entries, first_break=None, text=text, first=first, last_hash=last_hash
    )


def _problem(line: bytes, link: ChainLink | None, number: int, previous: str) -> str:
    """Return why a line is not the expected one; empty: it is."""
    if link is None:
        try:
            parse_line(line)
        except AuditError as error:
            return str(error)
    if link is None or not link.intact:
        return f"entry {number} was changed: its hash does not fit its contents"
    if (link.number, link.previous) != (number, previous):
        return f"something before entry {number} was taken out, put in or changed"
    return ""


def _is_being_written(file: BinaryIO) -> bool:
    """Return whether a gateway has the file open, so that a torn line may still be completed."""
    try:
        fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    fcntl.flock(file, fcntl.LOCK_UN)
    return False
