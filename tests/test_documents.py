"""Documents that say what the code says."""

from pathlib import Path

from robomesh.topics import REQUESTS, TOPICS, History

ROOT = Path(__file__).resolve().parents[1]


def topic_rows() -> list[str]:
    """The topic table of ARCHITECTURE.md, from the table that the code reads."""
    rows = [
        "| topic | schema | rate | priority | a `get` answers with | recorded | stale after |",
        "|" + "---|" * 7,
    ]
    for row in TOPICS.values():
        beat = f"on change, {row.heartbeat_s:g} s" if row.heartbeat_s else "as it comes"
        rate = f"{row.rate_hz:g} Hz" if row.rate_hz else beat
        stale = f"{row.stale_after_s:g} s" if row.stale_after_s else "never"
        history = "nothing" if row.history is History.NONE else row.history.value
        rows.append(
            f"| `{row.name}` | {row.schema.DESCRIPTOR.full_name} | {rate} | {row.priority.value} "
            f"| {history} | {'yes' if row.recorded else 'no'} | {stale} |"
        )
    return rows


def request_rows() -> list[str]:
    """The request table of ARCHITECTURE.md."""
    rows = ["| request | asked with | answered with | priority | answered by |", "|" + "---|" * 5]
    for row in REQUESTS.values():
        asked, answer = (s.DESCRIPTOR.name if s else "-" for s in (row.request, row.answer))
        owners = ", ".join(sorted(role.value for role in row.owners))
        answered = answer if row.answer else "bytes"
        rows.append(f"| `{row.name}` | {asked} | {answered} | {row.priority.value} | {owners} |")
    return rows


def test_architecture_shows_the_topic_table_as_it_is():
    text = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8")
    assert "\n".join(topic_rows()) in text
    assert "\n".join(request_rows()) in text
    assert len(text.splitlines()) < 200


def test_every_example_stands_in_the_readme():
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    for example in (ROOT / "examples").glob("*.py"):
        assert example.name in readme
    program = (ROOT / "examples" / "joints.py").read_text(encoding="utf-8")
    assert program.rpartition('"""\n')[2].strip() in readme
