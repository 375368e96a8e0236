"""Write docs/reference/topics.md from the topic table: `./dev run python tests/make_topics.py`."""

import sys
from pathlib import Path

if __name__ == "__main__":
    sys.path[0] = str(Path(__file__).parents[1])

from robomesh.contract.topics import REQUESTS, TOPICS, History

FILE = Path(__file__).resolve().parents[1] / "docs" / "reference" / "topics.md"

_HEAD = """# Topics and requests

Generated from `robomesh/contract/topics.py` by `tests/make_topics.py`; do not edit.

A key is `robomesh/<site>/<robot>/<name>`; topics of a whole site have `-` as the robot. The schemas are in
`robomesh/schemas/robomesh.proto`; those that begin with `foxglove.` are Foxglove's.
"""


def topic_rows() -> list[str]:
    """Return the rows of the table of topics."""
    rows = [
        "| topic | schema | rate | priority | a `get` returns | recorded | stale after |",
        "|" + "---|" * 7,
    ]
    for row in TOPICS.values():
        beat = f"on change, {row.heartbeat_s:g} s" if row.heartbeat_s else "on change"
        rate = f"{row.rate_hz:g} Hz" if row.rate_hz else beat
        stale = f"{row.stale_after_s:g} s" if row.stale_after_s else "never"
        history = "nothing" if row.history is History.NONE else row.history.value
        rows.append(
            f"| `{row.name}` | {row.schema.DESCRIPTOR.full_name} | {rate} | {row.priority.value} "
            f"| {history} | {'yes' if row.recorded else 'no'} | {stale} |"
        )
    return rows


def request_rows() -> list[str]:
    """Return the rows of the table of requests."""
    rows = ["| request | question | answer | priority | answered by |", "|" + "---|" * 5]
    for row in REQUESTS.values():
        asked, answer = (schema.DESCRIPTOR.name if schema else "-" for schema in (row.request, row.answer))
        answer = answer if row.answer else "bytes"
        owners = ", ".join(sorted(role.value for role in row.owners))
        rows.append(f"| `{row.name}` | {asked} | {answer} | {row.priority.value} | {owners} |")
    return rows


def document() -> str:
    """Return the text of docs/reference/topics.md."""
    return "\n".join([_HEAD, "## Topics", "", *topic_rows(), "", "## Requests", "", *request_rows(), ""])


if __name__ == "__main__":
    FILE.write_text(document(), encoding="utf-8")
