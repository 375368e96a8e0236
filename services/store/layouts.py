"""Named layouts of the robot's page: rules, and one file for the site.

    layouts.json   each layout with name, text, author and time

The file is replaced in one step, so a kill or a power cut leaves the layouts before a change or after it.
"""

import json
from pathlib import Path

from google.protobuf.json_format import MessageToDict, ParseDict, ParseError
from google.protobuf.timestamp_pb2 import Timestamp

from robomesh import reason_codes as codes
from robomesh.errors import RefusedError
from robomesh.files.atomic_write import write_atomically
from robomesh.reasons import Reason
from robomesh.schemas.robomesh_pb2 import LayoutList, LayoutRequest, StoredLayout
from services.store.history import check_name, name_key

MOST_LAYOUTS = 100
# Of one layout, and of all, which every page receives together.
LONGEST_TEXT, MOST_BYTES = 8000, 256 * 1024


class Layouts:
    """Layouts of a site. Its methods block on the disk; one at a time may be called.

    Args:
        folder: The site's folder.
    """

    def __init__(self, folder: Path) -> None:
        self._path = folder / "layouts.json"
        # By `name_key`.
        self._layouts: dict[str, StoredLayout] = {}

    @property
    def message(self) -> LayoutList:
        """The published list, sorted by name."""
        return _listed(self._layouts)

    def open(self) -> Reason | None:
        """Read the layouts; return what is damaged, which is renamed, so that nothing overwrites it.

        Raises:
            OSError: If the disk refuses.
        """
        if not self._path.exists():
            return None
        try:
            layouts = ParseDict(
                json.loads(self._path.read_bytes()), LayoutList(), ignore_unknown_fields=True
            ).layouts
            self._layouts = {name_key(each.name): each for each in layouts}
        except (ValueError, TypeError, AttributeError, RecursionError, ParseError) as error:
            self._path.replace(self._path.with_suffix(".damaged"))
            return codes.LAYOUTS_DAMAGED(detail=error or type(error).__name__)
        return None

    def change(self, asked: LayoutRequest, author: str, at_ns: int) -> None:
        """Save, rename or delete a layout.

        Raises:
            RefusedError: If the request is not possible; nothing has changed then.
        """
        after = dict(self._layouts)
        match asked.action:
            case LayoutRequest.SAVE:
                layout = StoredLayout(name=check_name(asked.name), text=_check_text(asked.text))
                self._check_name_is_free(
                    layout.name, unless=asked.replace or self._is_repeated(layout, author)
                )
            case LayoutRequest.RENAME:
                layout = StoredLayout(name=check_name(asked.new_name), text=self._named(asked.name).text)
                del after[name_key(asked.name)]
                self._check_name_is_free(layout.name, unless=name_key(layout.name) == name_key(asked.name))
            case LayoutRequest.DELETE:
                del after[name_key(self._named(asked.name).name)]
                return self._write(after)
            case _:
                raise RefusedError(codes.INVALID(codes.OTHER(detail="the request has no action")))
        layout.author = author
        at = Timestamp()
        at.FromNanoseconds(at_ns)
        layout.timestamp.CopyFrom(at)
        after[name_key(layout.name)] = layout
        size = sum(each.ByteSize() for each in after.values())
        if len(after) > MOST_LAYOUTS or size > MOST_BYTES:
            raise RefusedError(codes.LAYOUTS_FULL(most=MOST_LAYOUTS, most_kib=MOST_BYTES // 1024))
        return self._write(after)

    def _named(self, name: str) -> StoredLayout:
        layout = self._layouts.get(name_key(name))
        if layout is None:
            raise RefusedError(codes.LAYOUTS_UNKNOWN(name=check_name(name)))
        return layout

    def _is_repeated(self, layout: StoredLayout, author: str) -> bool:
        """Return whether a request, whose first answer was lost, was carried out already."""
        there = self._layouts.get(name_key(layout.name))
        return there is not None and (there.text, there.author) == (layout.text, author)

    def _check_name_is_free(self, name: str, *, unless: bool) -> None:
        there = self._layouts.get(name_key(name))
        if there is not None and not unless:
            raise RefusedError(codes.LAYOUTS_NAME_TAKEN(name=there.name, author=there.author))

    def _write(self, layouts: dict[str, StoredLayout]) -> None:
        data = json.dumps(MessageToDict(_listed(layouts)), ensure_ascii=False, indent=1).encode()
        try:
            write_atomically(self._path, data)
        except OSError as error:
            raise RefusedError(codes.PROGRAMS_DISK(detail=error.strerror or error)) from None
        self._layouts = layouts


def _listed(layouts: dict[str, StoredLayout]) -> LayoutList:
    return LayoutList(layouts=[layouts[key] for key in sorted(layouts)])


def _check_text(text: str) -> str:
    """Return a layout's text; the page checks its parts when it opens it.

    Raises:
        RefusedError: If it is no text of an address.
    """
    if len(text) > LONGEST_TEXT or not (text.isascii() and text.isprintable()) or " " in text:
        raise RefusedError(codes.LAYOUTS_TEXT(most=LONGEST_TEXT))
    return text
