"""The history of a day, as the page makes it from audit entries, events, notes and recordings."""

from datetime import UTC, date, datetime, timedelta
from zoneinfo import ZoneInfo

import pytest

from tests import page_modules
from web import build_page

RUN = """
const { day, gen, json } = await import(process.argv[1]);
const chunks = [];
for await (const chunk of process.stdin) chunks.push(chunk);
const asked = JSON.parse(Buffer.concat(chunks).toString());
const of = (schema) => (rows) => (rows ?? []).map((row) => json.fromJson(schema, row));
const answers = asked.map((one) => {
  if (one.date) return day.spanOfDay(one.date);
  const sources = {
    ...one,
    audit: of(gen.AuditEntrySchema)(one.audit),
    events: of(gen.EventSchema)(one.events),
    recordings: of(gen.RecordingSchema)(one.recordings),
  };
  const lines = day.linesOf(sources);
  return {
    lines: lines.map((line) => [line.kind, day.wordsOf(line), line.bad ?? false]),
    totals: day.totalsOf(sources),
    csv: day.exported(lines, [], String, true),
    text: day.exported(lines, ["head"], String, false),
  };
});
process.stdout.write(JSON.stringify(answers), () => process.exit(0));
"""
DAY = {"from": 1_800_000_000_000, "to": 1_800_086_400_000}


@pytest.fixture(scope="module")
def module(tmp_path_factory):
    """Return the path of the page's modules as one file for Node."""
    return page_modules.bundle(
        tmp_path_factory.mktemp("day"),
        day="features/events/day.ts",
        gen="gen/robomesh_pb.ts",
        json=build_page.MODULES / "@bufbuild/protobuf/dist/esm/index.js",
    )


def answers(module, *asked, zone="UTC"):
    """Return what the page's modules answer in a time zone."""
    return page_modules.run(module, RUN, asked, TZ=zone)


def stamp(second):
    return (datetime(2027, 1, 15, 8, 0, tzinfo=UTC) + timedelta(seconds=second)).isoformat()


def entry(second, request, operator="li", outcome="ACCEPTED", source="mesh", text="", **values):
    return {
        "timestamp": stamp(second),
        "request": request,
        "operator": operator,
        "outcome": outcome,
        "source": source,
        "text": text,
        "values": values,
    }


def event(second, code, severity="WARNING", source="gateway", **fields):
    return {"timestamp": stamp(second), "code": code, "severity": severity, "source": source, **fields}


def history(module, **sources):
    given = {"day": DAY, "now": DAY["to"], "before": {"stopped": False}, "eventsFrom": DAY["from"], **sources}
    return answers(module, given)[0]


@pytest.mark.slow
@pytest.mark.parametrize(
    "zone",
    ["Europe/Berlin", "America/New_York", "America/Santiago", "Asia/Beirut", "Australia/Lord_Howe", "UTC"],
)
def test_the_borders_of_every_day_of_a_year_are_those_of_the_zone(module, zone):
    days = [date(2027, 1, 1) + timedelta(days=each) for each in range(365)]
    spans = answers(module, *({"date": str(each)} for each in days), zone=zone)
    info = ZoneInfo(zone)
    for each, span in zip(days, spans, strict=True):
        begin, end = (
            datetime(at.year, at.month, at.day, tzinfo=info).timestamp() * 1000
            for at in (each, each + timedelta(days=1))
        )
        assert (span["from"], span["to"]) == (begin, end), each
    hours = {(span["to"] - span["from"]) / 3_600_000 for span in spans}
    assert hours == ({24} if zone == "UTC" else {23.5, 24, 24.5} if "Lord" in zone else {23, 24, 25})


@pytest.mark.slow
def test_a_day_is_told_in_sentences_with_runs_folded(module):
    runs = [
        each
        for n in range(12)
        for each in (
            entry(100 + 10 * n, "RUN_PROGRAM", program_name="pick"),
            entry(101 + 10 * n, "MOVE_ABSOLUTE", source="program"),
            entry(
                105 + 10 * n,
                "PROGRAM_END",
                outcome="FAILED" if n == 11 else "ACCEPTED",
                source="program",
                text="program pick ended at line 3: no link",
            ),
        )
    ]
    found = history(
        module,
        audit=[
            entry(0, "ACQUIRE"),
            entry(10, "HOME"),
            entry(20, "MOVE_RELATIVE"),
            *runs,
            entry(300, "STOP", operator="wang"),
            entry(360, "RESET"),
            entry(400, "RELEASE"),
        ],
        events=[
            event(230, "link.down", text="no link"),
            event(275, "link.up", "INFO"),
            event(
                500,
                "note.written",
                "INFO",
                "store",
                note={"id": "1", "author": "li", "text": "slips", "begin": stamp(50)},
            ),
            event(501, "note.withdrawn", "INFO", "store", note={"id": "1", "author": "li", "text": "slips"}),
            event(502, "programs.saved", "INFO", "store"),
        ],
        recordings=[{"name": "trial", "start": stamp(30), "duration": "75s", "file": "x.mcap"}],
    )
    kinds = [kind for kind, *_ in found["lines"]]
    assert kinds == ["control", "control", "recording", "note", "program", "alarm", "stop", "stop", "control"]
    texts = [text for _, text, _ in found["lines"]]
    assert texts[1] == "li: 2 commands"
    assert texts[2] == "Recording trial, 1 min 15 s"
    assert texts[3].endswith("slips (withdrawn)")
    assert texts[4] == "li ran program pick 12 times: 11 done; program pick ended at line 3: no link"
    assert texts[5].endswith("(over after 45 s)")
    assert found["totals"] == {
        "program": 60_000,
        "stopped": 60_000,
        "offline": 45_000,
        "unknown": DAY["to"] - DAY["from"] - 165_000,
    }


@pytest.mark.slow
def test_unknown_time_is_called_unknown(module):
    whole = DAY["to"] - DAY["from"]
    # A stop of the day before, reset at 08:01.
    found = history(module, audit=[entry(60, "RESET")], before={"stopped": True})
    assert found["totals"] == {"program": 0, "stopped": 60_000, "offline": 0, "unknown": whole - 60_000}
    # Events before the oldest one that is surely complete say nothing; a day that runs counts until now.
    down = [event(10, "link.down"), event(20, "link.up", "INFO")]
    found = history(module, events=down, eventsFrom=None, now=DAY["from"] + 100_000)
    assert found["totals"] == {"program": 0, "stopped": 0, "offline": 0, "unknown": 100_000}
    assert history(module, now=DAY["from"] - 5)["totals"]["unknown"] == 0


@pytest.mark.slow
def test_a_table_holds_no_formula_and_every_line_once(module):
    note = {"id": "1", "author": "=li", "text": '=1+1, "quoted"', "begin": stamp(0)}
    found = history(module, events=[event(0, "note.written", "INFO", "store", note=note)])
    header, row, rest = found["csv"].split("\r\n")
    assert (header, rest) == ("time,kind,text", "")
    assert row.startswith('"2027-01-15T08:00:00.000Z","note",')
    assert ',"=' not in row
    assert '""quoted""' in row
    assert found["text"].startswith("head\n\n")
