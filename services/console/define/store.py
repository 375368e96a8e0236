"""Files of drafts, stored by their SHA-256, and drafts as folders of links to them.

All of it may be deleted at any time: the page sends missing files again.
"""

import contextlib
import hashlib
import os
import re
import secrets
import shutil
import tempfile
import time
from collections.abc import AsyncIterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from robomesh import reason_codes as codes
from robots.descriptions.save_description import refused_path
from services.console.common.errors import RefusedRequest

MOST_BYTES = 2 * 1024**3
MOST_DRAFTS = 64
MOST_FILES = 2000
MOST_DRAFT_BYTES = 500_000_000
_DRAFTS_KEPT = 4
_LEFT_BEHIND_S = 7 * 24 * 3600.0
_SHA = re.compile(r"[0-9a-f]{64}")


@dataclass(frozen=True)
class Store:
    """A folder of files by content, and of drafts made of links to them.

    Attributes:
        folder: Readable by its owner only.
        most_bytes: Limit of all files; the least recently used are removed.
    """

    folder: Path
    most_bytes: int = MOST_BYTES

    @property
    def files(self) -> Path:
        """Folder of the files, each named by its SHA-256."""
        return self.folder / "files"

    @property
    def drafts(self) -> Path:
        """Folder of the drafts."""
        return self.folder / "drafts"


def open_store(folder: Path, *, most_bytes: int = MOST_BYTES) -> Store:
    """Open the store in a folder, or in a temporary one if the folder is not usable or not the user's own."""
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        usable = (
            folder.stat().st_uid == os.getuid() and os.access(folder, os.W_OK) and not folder.is_symlink()
        )
    except OSError:
        usable = False
    store = Store(folder if usable else Path(tempfile.mkdtemp(prefix="robomesh-define-")), most_bytes)
    store.folder.chmod(0o700)
    store.files.mkdir(exist_ok=True)
    store.drafts.mkdir(exist_ok=True)
    for left in store.folder.glob("tmp*"):
        # Left by a killed console; a recent one may be another console's.
        if time.time() - left.stat().st_mtime > _LEFT_BEHIND_S:
            shutil.rmtree(left) if left.is_dir() else left.unlink()
    return store


def put(store: Store, content: bytes) -> str:
    """Store a file; return its SHA-256."""
    sha = hashlib.sha256(content).hexdigest()
    if not _touch(store.files / sha):
        with _new_file(store) as path:
            path.write_bytes(content)
            path.replace(store.files / sha)
        _evict_files(store)
    return sha


async def put_stream(store: Store, chunks: AsyncIterable[bytes], *, most_bytes: int) -> tuple[str, int]:
    """Store a file from chunks; return its SHA-256 and size.

    Raises:
        RefusedRequest: If it is too large.
    """
    digest, size = hashlib.sha256(), 0
    with _new_file(store) as path:
        with path.open("wb") as file:
            async for chunk in chunks:
                size += len(chunk)
                if size > most_bytes:
                    raise RefusedRequest(413, codes.DEFINE_FILE_TOO_LARGE(megabytes=most_bytes / 1e6))
                digest.update(chunk)
                file.write(chunk)
        path.replace(store.files / digest.hexdigest())
    _evict_files(store)
    return digest.hexdigest(), size


def stored(store: Store, sha: str) -> Path | None:
    """Return the path of the file with that SHA-256, or None."""
    path = store.files / sha
    return path if _SHA.fullmatch(sha) and _touch(path) else None


def lay_out(store: Store, files: Mapping[str, str]) -> Path:
    """Return a folder with a draft's files under their names, each linked to the stored one.

    The same files give the same folder, so that edits in a form write nothing to disk.

    Raises:
        RefusedRequest: If a path is not below the folder, or a file is not in the store.
    """
    if len(files) > MOST_FILES:
        raise RefusedRequest(413, codes.DEFINE_TOO_MANY_FILES(count=len(files), most=MOST_FILES))
    for path in files:
        if reason := refused_path(path):
            raise RefusedRequest(422, reason)
    recipe = "\n".join(f"{sha} {path}" for path, sha in sorted(files.items()))
    folder = store.drafts / hashlib.sha256(recipe.encode()).hexdigest()
    if _touch(folder):
        return folder
    sources = {path: stored(store, sha) for path, sha in files.items()}
    if missing := [path for path, source in sources.items() if source is None]:
        raise RefusedRequest(410, codes.DEFINE_FILE_GONE(files=", ".join(missing[:5])))
    # A file under a thousand names is stored once, but saved a thousand times.
    size = sum(source.stat().st_size for source in sources.values() if source is not None)
    if size > MOST_DRAFT_BYTES:
        reason = codes.DEFINE_FILES_TOO_LARGE(
            count=len(files), megabytes=size / 1e6, most=MOST_DRAFT_BYTES / 1e6
        )
        raise RefusedRequest(413, reason)
    fresh = Path(tempfile.mkdtemp(dir=store.drafts))
    try:
        for path, source in sources.items():
            assert source is not None
            place = fresh.joinpath(*PurePosixPath(path).parts)
            place.parent.mkdir(parents=True, exist_ok=True)
            # A hard link: a symbolic one could lead out of the draft.
            os.link(source, place)
        fresh.rename(folder)
    except FileExistsError:
        raise RefusedRequest(422, codes.DEFINE_FILE_IS_FOLDER()) from None
    except OSError as error:
        if not folder.is_dir():  # otherwise a concurrent request made the same draft
            raise RefusedRequest(507, codes.DEFINE_DISK(detail=error.strerror)) from None
    finally:
        shutil.rmtree(fresh, ignore_errors=True)
    _evict_drafts(store, MOST_DRAFTS)
    return folder


@contextlib.contextmanager
def _new_file(store: Store) -> Iterator[Path]:
    """Yield a new temporary file in the store; remove it if it was not renamed."""
    descriptor, name = tempfile.mkstemp(dir=store.folder)
    os.close(descriptor)
    try:
        yield Path(name)
    finally:
        Path(name).unlink(missing_ok=True)


def _touch(path: Path) -> bool:
    """Mark a file as used now; return whether it exists."""
    try:
        os.utime(path)
    except FileNotFoundError:
        return False
    return True


def _evict_files(store: Store) -> None:
    found = []
    for path in store.files.iterdir():
        with contextlib.suppress(FileNotFoundError):
            stat = path.stat()
            found.append((stat.st_mtime_ns, stat.st_size, path))
    total = sum(size for _, size, _ in found)
    if total > store.most_bytes:
        # Links in drafts would keep removed files on the disk.
        _evict_drafts(store, _DRAFTS_KEPT)
    for _, size, path in sorted(found)[:-1]:
        if total <= store.most_bytes:
            return
        path.unlink(missing_ok=True)
        total -= size


def _evict_drafts(store: Store, most: int) -> None:
    drafts = []
    for path in store.drafts.iterdir():
        with contextlib.suppress(FileNotFoundError):
            drafts.append((path.stat().st_mtime_ns, path))
    for _, path in sorted(drafts)[: max(len(drafts) - most, 0)]:
        # Renamed first, so that a half-removed draft is never used.
        going = store.folder / f"tmp-{secrets.token_hex(8)}"
        with contextlib.suppress(FileNotFoundError):
            path.rename(going)
            shutil.rmtree(going, ignore_errors=True)
