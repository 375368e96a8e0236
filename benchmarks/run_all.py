"""All benchmarks that have a target for speed, each with its peers, as one table.

    ./dev run python -m benchmarks run_all [--rows kinematics,gateway,...] [--peers-python PYTHON]
        [--nats-server FILE] [--minutes 20] [--growth] [--json] [--from RESULTS.json]

It starts the other programs of this folder, which measure. The rows take turns,
so that other load on the machine affects all of them; a ratio is that of values from the same round. The
table has medians, and least and most in brackets. PYTHON is a separate Python with mujoco, vtk, pyrender,
mcap, foxglove-sdk, nats-py, ikpy and roboticstoolbox-python; a nats-server beside it is found. The table
names the peers that are missing, and the programs that fail or take too long. No program starts that cannot
end within --minutes. Ctrl-C ends everything and prints the table so far.

--growth runs other rows: the cost at 1, 10 and 100 robots, monitors or views, and its exponent (the slope of
log cost over log count: 1 is proportional). It says before how long this takes. --json prints every program's
result too; --from prints the table of such a file again.
"""

import contextlib
import json
import math
import os
import platform
import shutil
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from typer import BadParameter, Option

from benchmarks.harness.program import ROOT, chosen, say
from benchmarks.harness.turns import spread

COUNTS = (1, 10, 100)
# A program gets this much more time than it takes on an idle machine, before it is ended.
PATIENCE, LEAST_LIMIT_S = 6.0, 60.0
ENDS_WITHIN_S = 15.0

# A program's lines on standard error with one of these say what it left out.
NOTES = ("skipped", "not measured", "not started", "no peers")

# A row's results of a round, by program.
Results = dict[str, Any]
# The value of robomesh, and those of the peers by name. Several values: of as many repeats.
Values = tuple[float | list[float], dict[str, float | list[float]]]


@dataclass(frozen=True)
class Run:
    """A program to start.

    Attributes:
        seconds: About its duration on an idle machine.
        rounds: In which rounds it runs.
        peers: Whether it takes --peers-python.
    """

    program: str
    arguments: tuple[str, ...]
    seconds: float
    rounds: range = range(1)
    peers: bool = False

    @property
    def name(self) -> str:
        return " ".join((self.program, *self.arguments))


@dataclass(frozen=True)
class Line:
    """A line of the table.

    Attributes:
        read: Reads the values from the results of one round; KeyError: they have none.
        peers: Names of all peers that `read` may return.
    """

    row: str
    work: str
    unit: str
    read: Callable[[Results], Values]
    peers: tuple[str, ...]
    reach: str


# ------------------------------------------------------------------------- rows

ARMS = "robomesh,zenoh"
MORE_ARMS = f"{ARMS},robomesh-plain,zenoh-plain,nats,foxglove"
BARE = Run("kinematics", ("--targets", "200"), 30, range(3), peers=True)

ROWS: dict[str, tuple[Run, ...]] = {
    "kinematics": (Run("live_kinematics", ("--robots", "10", "--seconds", "8"), 22, range(3)), BARE),
    "gateway": (Run("gateway", ("--robots", "100", "--seconds", "5"), 28, range(3)),),
    "fanout": (
        Run("fanout", fanout := ("--monitors", "64", "--seconds", "3", "--repeats", "1", "--arms", MORE_ARMS),
            60, range(3), peers=True),
        Run("fanout", (*fanout[:-1], ARMS), 22, range(3, 7)),
    ),
    "render": (
        Run("renderer", ("--rounds", "1", "--turns", "6", "--only", "720p/4x/100k/1,720p/0x/20k/1"),
            20, range(3), peers=True),
    ),
    "recorder": (
        Run("recorder", ("--rates", "50000,75000,100000", "--robots", "0", "--megabytes", "0",
                         "--seconds", "4"), 45, range(2), peers=True),
    ),
    "ik": (BARE,),
    "video": (
        Run("video", ("--seconds", "6", "--viewers", "1"), 75, range(2)),
        Run("latency", ("--seconds", "5", "--video"), 20, range(2)),
    ),
    "start": (Run("start", ("--runs", "3"), 60),),
}  # fmt: skip


def kinematics(results: Results) -> Values:
    service = results["live_kinematics"]
    robots, ours = service["robots"], 100 * service["cpu_share"]
    if not (bare := results.get("kinematics")):
        return ours, {}
    rates = next(each for each in bare["forward"] if each["arm"] == "pt600")
    frames = 100 * 60 * robots / rates["pinocchio"]
    clearances = 100 * 20 * robots / bare["collision"]["outside_within_warning"]
    return ours, {"FK + Jacobian in Pinocchio": frames, "and clearance in coal": frames + clearances}


def of_gateway(name: str) -> Callable[[Results], Values]:
    def read(results: Results) -> Values:
        (row,) = results["gateway"]["robots"]
        if name == "cpu":
            return row["cpu_us"], {"bare put": row["bare_cpu_us"]}
        return row["unit"][name], {"bare put": row["bare"][name]}

    return read


FANOUT = {
    "zenoh": "bare Zenoh with TLS",
    "robomesh-plain": "ours without TLS",
    "zenoh-plain": "bare Zenoh without TLS",
    "nats": "NATS",
    "foxglove": "foxglove-sdk",
}


def of_fanout(name: str) -> Callable[[Results], Values]:
    def read(results: Results) -> Values:
        by_arm = {row["arm"]: row[name] for row in results["fanout"]["rows"]}
        return by_arm["robomesh"], {FANOUT[arm]: by_arm[arm] for arm in FANOUT if arm in by_arm}

    return read


RENDERERS = {
    "mujoco": "mujoco",
    "vtk": "vtk",
    "pyrender": "pyrender",
    "ours, whole": "ours with every triangle",
}


def of_render(height: int, samples: int, count: str) -> Callable[[Results], Values]:
    def read(results: Results) -> Values:
        (row,) = [
            row
            for row in results["renderer"]["rows"]
            if (row["size"][1], row["samples"], row["count"]) == (height, samples, count)
        ]
        peers = {label: row[name]["cpu_ms"] for name, label in RENDERERS.items() if name in row}
        return row["ours"]["cpu_ms"], peers

    return read


def recorder(results: Results) -> Values:
    result = results["recorder"]
    # The greatest rate without a loss; 0: each rate lost messages.
    whole = [row["messages_per_s"] for row in result["one_robot"] if row["in_files"] == row["published"]]
    writers = result["writers"]
    peers = {"mcap": "mcap", "foxglove-sdk": "foxglove-sdk", "our writer alone": "ours"}
    return float(max(whole, default=0)), {
        peer: writers[name]["messages_per_s"]
        for peer, name in peers.items()
        if "messages_per_s" in writers.get(name, {})
    }


def of_search(name: str) -> Callable[[Results], Values]:
    def read(results: Results) -> Values:
        rows = results["kinematics"]["inverse"]
        arm = "panda" if any(row["arm"] == "panda" for row in rows) else "puma560"
        by_solver = {row["who"]: row[name] for row in rows if row["arm"] == arm}
        peers = {peer: by_solver[peer] for peer in ("roboticstoolbox", "ikpy") if peer in by_solver}
        if name == "mean_ms":
            peers["TRAC-IK on Panda, quoted"] = results["kinematics"]["trac_ik_read"]["panda"][1]
        return by_solver["ours, by search"], peers

    return read


def video(results: Results) -> Values:
    delays = results.get("latency", {}).get("latency_ms", {})
    names = {"unit -> H.264 packet": "to the packet", "bare put -> subscriber": "bare put"}
    return results["video"]["unit_to_drawn_ms"]["p50"], {
        peer: delays[name]["p50"] for name, peer in names.items() if name in delays
    }


def of_start(kind: str, name: str) -> Callable[[Results], Values]:
    def read(results: Results) -> Values:
        values = [row[name] for row in results["start"]["starts"][kind]]
        if name != "cpu_s":
            return values, {}
        imports = results["start"]["imports"]
        return values, {
            "imports alone": [imports["imports_s"]] * len(values),
            "empty Pythons": [imports["python_s"]] * len(values),
        }

    return read


LINES = (
    Line("kinematics", "kinematics service, 10 arms x 100 Hz in, 60 Hz frames, 20 Hz state with clearance",
         "% of a core", kinematics, ("FK + Jacobian in Pinocchio", "and clearance in coal"), "at most 15 %"),
    Line("gateway", "gateway, 100 robots x 100 Hz, processor time a unit", "us",
         of_gateway("cpu"), ("bare put",), "at most 40 us"),
    Line("gateway", "the same, p99", "ms", of_gateway("p99"), ("bare put",), "at most 2x the bare put"),
    Line("fanout", "fan-out to 64, TLS, p50", "ms", of_fanout("p50_ms"), (*FANOUT.values(),), ""),
    Line("fanout", "the same, p99", "ms", of_fanout("p99_ms"), (*FANOUT.values(),),
         "at most 1.2x bare with TLS"),
    Line("render", "render 720p with 4x, 107 k triangles, processor time", "ms", of_render(720, 4, "100k"),
         (*RENDERERS.values(),), "ahead of MuJoCo"),
    Line("render", "render 720p without, 27 k triangles, processor time", "ms", of_render(720, 0, "20k"),
         (*RENDERERS.values(),), "at most 1.2x MuJoCo"),
    Line("recorder", "recorder from the mesh, most of 50,000, 75,000, 100,000 without loss; peers: no mesh",
         "messages/s", recorder, ("mcap", "foxglove-sdk", "our writer alone"), "100,000"),
    Line("ik", "IK by search, median", "ms", of_search("median_ms"), ("roboticstoolbox", "ikpy"), "0.06 ms"),
    Line("ik", "the same, mean", "ms", of_search("mean_ms"),
         ("roboticstoolbox", "ikpy", "TRAC-IK on Panda, quoted"), ""),
    Line("video", "unit -> picture in Chromium, p50; peers: parts of the way", "ms", video,
         ("to the packet", "bare put"), "45 ms"),
    Line("start", "`robomesh up` until joints flow, cold", "s", of_start("cold", "joints_s"), (), ""),
    Line("start", "the same, warm", "s", of_start("warm", "joints_s"), (), "2 s"),
    Line("start", "processor time of all processes until then, warm; peers: parts of it", "s",
         of_start("warm", "cpu_s"), ("imports alone", "empty Pythons"), ""),
)  # fmt: skip


# ----------------------------------------------------------------------- growth


@dataclass(frozen=True)
class Growth:
    """A row of the second table.

    Attributes:
        run: Returns the program for a count.
        costs: Reads the cost of robomesh and those of the peers from a result; KeyError: it has none.
    """

    row: str
    work: str
    unit: str
    run: Callable[[int], Run]
    costs: Callable[[Any], dict[str, float]]


def grown_kinematics(result: Any) -> dict[str, float]:
    # Of a state of each robot, so that a service that falls behind does not look cheap.
    return {"robomesh": 1e3 * result["cpu_share"] / result["rate_hz"]}


def grown_gateway(result: Any) -> dict[str, float]:
    (row,) = result["robots"]
    return {
        "robomesh": row["robots"] * row["cpu_us"] / 1e3,
        "bare put": row["robots"] * row["bare_cpu_us"] / 1e3,
    }


def grown_recorder(result: Any) -> dict[str, float]:
    row = result["all_topics"]
    return {"robomesh": row["cpu_us_per_message"] * row["messages_per_s"] / 1e3}


def grown_fanout(result: Any) -> dict[str, float]:
    names = {"robomesh": "robomesh", "zenoh": "bare Zenoh"}
    return {names[row["arm"]]: 1e3 * row["cores"]["servers"] / row["delivered"] for row in result["rows"]}


def grown_views(result: Any) -> dict[str, float]:
    row = result["rates"][0]
    return {"robomesh": 1e3 * row["cores"] / statistics.fmean(row["rates"])}


GROWTH = (
    Growth("kinematics", "kinematics service, a state of each robot", "ms",
           lambda n: Run("live_kinematics", ("--robots", str(n), "--seconds", "5"), 25 + n / 2),
           grown_kinematics),
    Growth("gateway", "gateway, a unit of each robot", "ms",
           lambda n: Run("gateway", ("--robots", str(n), "--seconds", "5"), 30), grown_gateway),
    Growth("recorder", "recorder, a second of all topics of each robot", "ms",
           lambda n: Run("recorder", ("--rates", "", "--robots", str(n), "--megabytes", "0",
                                      "--seconds", "5"), 25 + n / 4), grown_recorder),
    Growth("fanout", "fan-out with TLS, a second of 10 robots and a video to each monitor, the router", "ms",
           lambda n: Run("fanout", ("--monitors", str(n), "--seconds", "4", "--repeats", "1", "--arms", ARMS),
                         25 + n / 4), grown_fanout),
    Growth("views", "renderer, a picture of 1280 x 720 of each view", "ms",
           lambda n: Run("streams", ("--views", str(n), "--seconds", "5"), 45 + n / 2), grown_views),
)  # fmt: skip


# ------------------------------------------------------------------- programs


def measure(
    rows: Annotated[str, Option(help=f"of {', '.join(ROWS)}; with --growth of "
                                f"{', '.join(each.row for each in GROWTH)}")] = "",
    peers_python: Annotated[str, Option(metavar="PYTHON")] = "",
    nats_server: Annotated[str, Option(metavar="FILE")] = "",
    minutes: Annotated[float, Option(help="20 if 0; with --growth no limit")] = 0.0,
    growth: Annotated[bool, Option("--growth")] = False,
    recorded: Annotated[str, Option("--from", metavar="RESULTS.json")] = "",
) -> Iterator[dict[str, Any]]:  # fmt: skip
    if recorded:
        try:
            yield whole(json.loads(Path(recorded).read_text()))
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise BadParameter(f"--from {recorded}: not the JSON of run_all: {error}") from None
        return
    known = [each.row for each in GROWTH] if growth else [*ROWS]
    names = chosen("--rows", rows, known) or known
    if peers_python and not shutil.which(peers_python):
        raise BadParameter(f"--peers-python {peers_python}: no such program")
    plan = grown(names) if growth else rounds(names)
    minutes = minutes or (math.inf if growth else 20.0)
    expected = sum(run.seconds for _, run in plan) / 60
    say(f"about {expected:.0f} minutes on two idle cores, {len(plan)} programs")
    # Both, because a shell lets background programs ignore Ctrl-C, and the programs started here would too.
    for each in (signal.SIGINT, signal.SIGTERM):
        signal.signal(each, signal.default_int_handler)
    result: dict[str, Any] = {
        "growth": growth,
        "rows": names,
        "peers": bool(peers_python),
        "machine": machine(),
        "begun": time.strftime("%Y-%m-%d %H:%M UTC", time.gmtime()),
        "load_before": os.getloadavg(),
        "runs": [],
    }
    begun, interrupted = time.monotonic(), False
    try:
        for number, (round_, run) in enumerate(plan):
            left_s = begun + 60 * minutes - time.monotonic()
            what = {"round": round_, "program": run.program, "arguments": run.arguments}
            if left_s < run.seconds:
                outcome: dict[str, Any] = {"failed": f"not started: --minutes {minutes:g} are over"}
            else:
                outcome = outcome_of(
                    run, min(left_s, max(LEAST_LIMIT_S, PATIENCE * run.seconds)), peers_python, nats_server
                )
            result["runs"].append(what | outcome)
            told = f"{outcome['took_s']:.0f} s" if "took_s" in outcome else "-"
            why = f": {outcome['failed']}" if "failed" in outcome else ""
            say(f"{number + 1}/{len(plan)} {run.name}: {told}{why}")
    except KeyboardInterrupt:
        interrupted = True
    result |= {"took_s": time.monotonic() - begun, "load_after": os.getloadavg(), "interrupted": interrupted}
    yield whole(result)
    if interrupted:
        sys.exit(130)


def show(result: dict[str, Any]) -> None:
    print(markdown(result))


def machine() -> str:
    with contextlib.suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return f"{os.cpu_count()} cores, {line.partition(':')[2].strip()}"
    return f"{os.cpu_count()} cores, {platform.machine()}"


def rounds(rows: Sequence[str]) -> list[tuple[int, Run]]:
    """Return the programs of all rounds; what two rows need runs once a round."""
    runs = dict.fromkeys(run for row in rows for run in ROWS[row])
    last = max(run.rounds.stop for run in runs)
    return [(number, run) for number in range(last) for run in runs if number in run.rounds]


def grown(rows: Sequence[str]) -> list[tuple[int, Run]]:
    return [(count, each.run(count)) for each in GROWTH if each.row in rows for count in COUNTS]


def outcome_of(run: Run, limit_s: float, peers_python: str, nats: str) -> dict[str, Any]:
    """Run a program to its end, and return its result, or why it has none.

    Ctrl-C and the limit end the program and all that it started.
    """
    command = [sys.executable, "-m", "benchmarks", run.program, *run.arguments, "--json"]
    if run.peers and peers_python:
        command += ["--peers-python", peers_python]
        if run.program == "fanout" and (server := nats or nats_beside(peers_python)):
            command += ["--nats-server", server]
    begun = time.monotonic()
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as errors:
        process = subprocess.Popen(
            command,
            stdout=out,
            stderr=errors,
            stdin=subprocess.DEVNULL,
            cwd=ROOT,
            start_new_session=True,
        )
        try:
            process.wait(limit_s)
            failed = f"status {process.returncode}" if process.returncode else ""
        except subprocess.TimeoutExpired:
            failed = f"ended after {limit_s:.0f} s"
        finally:
            end(process)
        out.seek(0)
        errors.seek(0)
        output, said = (text.decode(errors="replace").splitlines() for text in (out.read(), errors.read()))
    result: dict[str, Any] = {"took_s": time.monotonic() - begun, "load": os.getloadavg()[0]}
    if not failed:
        try:
            # Without NaN, which is not JSON.
            result["result"] = json.loads(output[-1], parse_constant=lambda _: None)
        except (IndexError, ValueError):
            failed = "printed no JSON"
    if notes := [line for line in said if any(word in line for word in NOTES)]:
        result["notes"] = notes
    if failed:
        result["failed"] = f"{failed}: {said[-1]}" if said else failed
    return result


def nats_beside(python: str) -> str:
    """Return the nats-server in the folder of a Python; "" if it has none."""
    server = Path(shutil.which(python) or "").with_name("nats-server")
    return str(server) if server.exists() else ""


def end(process: "subprocess.Popen[bytes]") -> None:
    """End the rest of a program's session: first as Ctrl-C does, then without asking."""
    if process.poll() is None:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGINT)
        with contextlib.suppress(subprocess.TimeoutExpired, KeyboardInterrupt):
            process.wait(ENDS_WITHIN_S)
    for pid in session_of(process.pid):
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)
    process.wait()


def session_of(leader: int) -> Iterator[int]:
    """Yield the processes of a session."""
    for file in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            if int(file.read_text().rpartition(")")[2].split()[3]) == leader:
                yield int(file.parent.name)


# ---------------------------------------------------------------------- tables


def whole(result: dict[str, Any]) -> dict[str, Any]:
    """Return the results with the table."""
    return {**result, "table": growth_table(result) if result["growth"] else table(result)}


def table(result: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the lines of the first table: values of each round, their medians and spread, and the ratios."""
    return [line_of(line, result) for line in LINES if line.row in result["rows"]]


def line_of(line: Line, result: dict[str, Any]) -> dict[str, Any]:
    programs = {run.program for run in ROWS[line.row]}
    runs = [run for run in result["runs"] if run["program"] in programs]
    ours: list[float] = []
    peers: dict[str, list[float]] = {}
    ratios: dict[str, list[float]] = {}
    for number in sorted({run["round"] for run in runs}):
        found = {run["program"]: run["result"] for run in runs if run["round"] == number and "result" in run}
        try:
            own, others = line.read(found)
        except (KeyError, StopIteration, TypeError, ValueError):
            continue
        own_values = listed(own)
        ours += own_values
        for peer, value in others.items():
            peers.setdefault(peer, []).extend(listed(value))
            ratios.setdefault(peer, []).extend(
                mine / theirs for mine, theirs in zip(own_values, listed(value), strict=False) if theirs
            )
    failed = dict.fromkeys(f"{run['program']}: {run['failed']}" for run in runs if "failed" in run)
    return {
        "work": line.work,
        "unit": line.unit,
        "today": spread_of(ours),
        "peers": {peer: spread_of(values) for peer, values in peers.items()},
        "ratios": {peer: spread_of(values) for peer, values in ratios.items()},
        "reach": line.reach,
        "missing": [peer for peer in line.peers if not peers.get(peer)],
        "failed": [*failed],
    }


def listed(value: float | list[float]) -> list[float]:
    """Return the values that there are: a program without a sample gives null."""
    values = value if isinstance(value, list) else [value]
    return [each for each in values if each is not None and math.isfinite(each)]


def spread_of(values: Sequence[float]) -> dict[str, float] | None:
    """Return median, least, most and number of values; None if there are none."""
    return {**spread(values), "n": len(values)} if values else None


def growth_table(result: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the lines of the second table: the cost at each count, and the exponents."""
    lines = []
    for growth in GROWTH:
        if growth.row not in result["rows"]:
            continue
        costs: dict[str, dict[int, float]] = {"robomesh": {}}
        failed = []
        for count in COUNTS:
            run = growth.run(count)
            for done in result["runs"]:
                if (done["program"], tuple(done["arguments"])) != (run.program, run.arguments):
                    continue
                if "failed" in done:
                    failed.append(f"{count}: {done['failed']}")
                    continue
                try:
                    for name, cost in growth.costs(done["result"]).items():
                        if math.isfinite(cost) and cost > 0:
                            costs.setdefault(name, {})[count] = cost
                        else:
                            failed.append(f"{count}, {name}: no cost (0, or nothing delivered)")
                except (KeyError, TypeError, ValueError, ZeroDivisionError):
                    failed.append(f"{count}: no cost in its result")
        lines += [
            {
                "work": growth.work,
                "who": name,
                "unit": growth.unit,
                "costs": {str(count): cost for count, cost in of_count.items()},
                "exponent": exponent(of_count),
                "last_exponent": exponent({n: of_count[n] for n in COUNTS[-2:] if n in of_count}),
                "failed": failed if name == "robomesh" else [],
            }
            for name, of_count in costs.items()
        ]
    return lines


def exponent(costs: dict[int, float]) -> float | None:
    """Return the slope of log cost over log count, by least squares; None with fewer than two counts."""
    if len(costs) < 2:
        return None
    fit = statistics.linear_regression([*map(math.log, costs)], [*map(math.log, costs.values())])
    return fit.slope


def markdown(result: dict[str, Any]) -> str:
    """Return the table in Markdown, with what it was measured on."""
    lines = growth_markdown(result) if result["growth"] else table_markdown(result)
    command = "benchmarks run_all" + (" --growth" if result["growth"] else "")
    lines += [
        "",
        f"{result['machine']}; {result['begun']}, {result['took_s'] / 60:.1f} minutes (`{command}`); load "
        f"average {result['load_before'][0]:.1f} before, {result['load_after'][0]:.1f} after"
        + ("; interrupted" if result["interrupted"] else "")
        + ".",
    ]
    notes = dict.fromkeys(note for run in result["runs"] for note in run.get("notes", ()))
    notes |= dict.fromkeys(
        f"{name}: {why}"
        for run in result["runs"]
        for name, why in (run.get("result") or {}).get("missing", {}).items()
    )
    if notes:
        lines += ["", *(f"- {note}" for note in notes)]
    return "\n".join(lines)


def table_markdown(result: dict[str, Any]) -> list[str]:
    lines = ["| work | today | peer in the same run | ratio | reach |", "|---|---|---|---|---|"]
    for line in table(result):
        unit = line["unit"]
        today = f"{words(line['today'])} {unit}" if line["today"] else "not measured"
        if line["failed"]:
            today += f" ({'; '.join(map(escaped, line['failed']))})"
        peers = [f"{name} {words(values)}" for name, values in line["peers"].items() if values]
        if line["missing"]:
            peers.append(f"not measured: {', '.join(line['missing'])}")
        ratios = [f"{name} {words(values)}" for name, values in line["ratios"].items() if values]
        cells = (line["work"], today, "; ".join(peers) or "-", "; ".join(ratios) or "-", line["reach"] or "-")
        lines.append(f"| {' | '.join(cells)} |")
    return lines


def growth_markdown(result: dict[str, Any]) -> list[str]:
    head = " | ".join(map(str, COUNTS))
    lines = [
        f"| processor time | of | {head} | exponent | {COUNTS[-2]} to {COUNTS[-1]} |",
        "|---|---" + "|---" * 5 + "|",
    ]
    for line in growth_table(result):
        costs = [line["costs"].get(str(count)) for count in COUNTS]
        cells = [line["work"], line["who"]]
        cells += ["-" if cost is None else f"{figure(cost)} {line['unit']}" for cost in costs]
        cells += [
            "-" if each is None else f"{each:.2f}" for each in (line["exponent"], line["last_exponent"])
        ]
        if line["failed"]:
            cells[0] += f" (not measured: {'; '.join(map(escaped, line['failed']))})"
        lines.append(f"| {' | '.join(cells)} |")
    return lines


def words(values: dict[str, float]) -> str:
    """Return a median, with its spread if it has several values."""
    median = figure(values["median"])
    if values["n"] < 2:
        return median
    return f"{median} ({figure(values['least'])} to {figure(values['most'])})"


def figure(value: float) -> str:
    """Return a value with three digits, large ones whole."""
    if abs(value) >= 100 or value == 0:
        return f"{value:,.0f}"
    return f"{value:.{max(0, 2 - math.floor(math.log10(abs(value))))}f}"


def escaped(text: str) -> str:
    return text.replace("|", "\\|")
