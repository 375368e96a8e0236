"""The files of one robot's audit log: <robot>.jsonl is written, <robot>.<first number>.jsonl are older parts.

Older parts may have been taken away to an archive: the chain is then checked from the first entry
that is still there, and how many are not is said. What is taken out anywhere else is a break.
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

from protocol_gateway.audit.entry import NO_PREVIOUS, ChainLink, Entry, chain_link, parse_line
from protocol_gateway.audit.persisted_state import starts_file
from protocol_gateway.errors import AuditError

# No entry is nearly as long; whoever reads somebody's file must not fill the memory with its one line.
LONGEST_LINE = 1 << 20
_PART = re.compile(r"(.+)\.(\d{9,18})\.jsonl")


@dataclass(frozen=True, kw_only=True)
class Verification:
    """Whether a log is whole.

    Attributes:
        entries: How many were found whole.
        first_break: Number of the first entry that is not as it was written; None: none.
        first: Number of the first entry that is here: above 1 where older parts were taken away.
        last_hash: Of the last whole entry.
    """

    ok: bool
    entries: int
    first_break: int | None
    text: str
    first: int = 1
    last_hash: str = NO_PREVIOUS


def part_name(live: Path, first: int) -> Path:
    """The name of an older part of a log, by the number of its first entry."""
    return live.with_name(f"{live.stem}.{first:09d}.jsonl")


def first_number(part: Path) -> int:
    """The number of an older part's first entry, by its name."""
    matched = _PART.fullmatch(part.name)
    return int(matched[2]) if matched is not None else 0


def older_parts(live: Path) -> list[Path]:
    """The older parts beside a log's live file, oldest first; of a part itself: none."""
    if _PART.fullmatch(live.name):
        return []
    found = []
    for path in live.parent.glob(f"{glob.escape(live.stem)}.*.jsonl"):
        matched = _PART.fullmatch(path.name)
        if matched is not None and matched[1] == live.stem:
            found.append(path)
    return sorted(found, key=first_number)


def open_files(live: Path, *, newest_first: bool = False) -> Iterator[BinaryIO]:
    """Every file of a log, open one after the other.

    Raises:
        OSError: If the live file cannot be read.
    """
    with ExitStack() as stack:
        # The live one first: should the log be rotated now, it is what the newest part will be.
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
    """The lines of a file; one that is too long for an entry comes without its middle."""
    while line := file.readline(LONGEST_LINE):
        piece = line
        while len(piece) == LONGEST_LINE and not piece.endswith(b"\n"):
            piece = file.readline(LONGEST_LINE)
        yield line if piece is line else line[:-1] + piece[-1:]


def read_entries(live: Path) -> Iterator[Entry]:
    """Every readable entry of a log, oldest first; no file: none."""
    if not live.exists():
        return
    for file in open_files(live):
        for line in lines_of(file):
            try:
                yield parse_line(line)
            except AuditError:
                continue  # `verify` tells where; who only looks for something goes on


def verify(live: Path, head: str | None = None) -> Verification:
    """Check a log's chain, and that the entry whose hash is `head` is still in it.

    Args:
        live: The log's file, with whose older parts beside it the check begins; or one older part alone.

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
    """Why a line is not the one that belongs there; empty: it is."""
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
    """Whether a gateway has the file open: what is torn now may be whole in a moment."""
    try:
        fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    fcntl.flock(file, fcntl.LOCK_UN)
    return False
