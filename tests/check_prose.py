"""Check that prose is plain English: `./dev check` runs it.

Usage: check_prose.py [--list N]

Measures, by kind of text, the share of docstrings that begin with a question word ("What", "Whether")
instead of a verb or a noun phrase, and the number of idiomatic words in 1,000. Text within the limits can
still be hard to read. `--list N` prints the N worst places.
"""

import ast
import io
import re
import subprocess
import sys
import tokenize
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = (
    "robomesh",
    "robots",
    "protocol_gateway",
    "controllers",
    "renderer",
    "services",
    "web",
    "benchmarks",
    "tests",
    "examples",
    "deploy",
)
PROGRAMS = (Path("dev"),)
"""Python programs without a suffix."""

# A docstring begins with a verb in the imperative, or with a noun phrase.
QUESTION_WORD = re.compile(
    r"(?:What|Whether|Who|Whom|Whose|Whoever|How|Where|Wherever|Why|When|That|Which|Of what|As|So)\b"
)
# Words that hide the actor, and idioms that a reader of technical English does not expect.
IDIOM = re.compile(
    r"""\b(?:who-?ever|nobody|no\ one|somebody|someone|anew|tells?|told|meanwhile|thither|hither|nought|
    mend(?:s|ed|ing)?|becomes?\ of|came\ of|for\ itself|of\ its\ own|of\ one's\ own|all\ the\ same|
    now\ and\ then|at\ once|by\ itself|beside|(?<!no\ )such(?!\ as\b)|whose|
    what\ is|as\ it\ is|is\ so|was\ so|were\ so|of\ ours|
    goes?\ lost|foreign|door|lies|stands?|mind:|does\ well|is\ none|long\ since|in\ vain)\b""",
    re.IGNORECASE | re.VERBOSE,
)
# Functions and methods with a text for people as their first argument.
PRINTS = {"debug", "info", "warning", "error", "exception", "critical", "exit", "say"}
# What is quoted is a name, not prose: code, keys, addresses, the words of a command.
QUOTED = re.compile(r"``[^`]*``|`[^`]*`|https?://\S+|\]\([^)]*\)")
FENCE = re.compile(r"^(```|~~~).*?^\1\s*?$", re.MULTILINE | re.DOTALL)
PROTO_COMMENT = re.compile(r"//\s?(.*)")
WEB_COMMENT = re.compile(r"/\*\*?(.*?)\*/|(?<![:\w\"'])//[ \t]?([^\n]*)", re.DOTALL)


@dataclass(frozen=True)
class Text:
    """A piece of prose: where it is, and whether it is a docstring."""

    path: Path
    line: int
    prose: str
    docstring: bool = False

    @property
    def asks(self) -> bool:
        """Return whether this is a docstring that begins with a question word."""
        return self.docstring and QUESTION_WORD.match(self.prose) is not None

    @property
    def idioms(self) -> list[str]:
        """Return the idiomatic words in it."""
        return IDIOM.findall(QUOTED.sub(" ", self.prose))

    @property
    def words(self) -> int:
        """Return the number of words in it."""
        return len(self.prose.split())


def docstrings(path: Path, tree: ast.Module) -> Iterator[Text]:
    """Yield the docstrings of a module."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            text = ast.get_docstring(node)
            if text:
                yield Text(path, getattr(node, "lineno", 1), text, docstring=True)


def comments(path: Path, source: str) -> Iterator[Text]:
    """Yield the comments of a module."""
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.COMMENT:
            yield Text(path, token.start[0], token.string.lstrip("# "))


def messages(path: Path, tree: ast.Module) -> Iterator[Text]:
    """Yield the texts that people read: of errors, log lines, status lines, and a command's help."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call):
            yield from (Text(path, node.lineno, text) for each in node.exc.args for text in _literal(each))
        elif isinstance(node, ast.Call):
            if _called(node) in PRINTS and node.args:
                yield from (Text(path, node.lineno, text) for text in _literal(node.args[0]))
            for keyword in node.keywords:
                if keyword.arg == "help":
                    yield from (Text(path, node.lineno, text) for text in _literal(keyword.value))


def _called(call: ast.Call) -> str:
    """Return the name of the called function or method."""
    if isinstance(call.func, ast.Name):
        return call.func.id
    return call.func.attr if isinstance(call.func, ast.Attribute) else ""


def _literal(node: ast.expr) -> Iterator[str]:
    """Yield the constant text of a string or an f-string."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        yield node.value
    elif isinstance(node, ast.JoinedStr):
        parts = (part.value for part in node.values if isinstance(part, ast.Constant))
        yield " ".join(part for part in parts if isinstance(part, str))


def documents(path: Path, source: str) -> Iterator[Text]:
    """Yield the paragraphs of a Markdown file, without its code."""
    prose = FENCE.sub(lambda block: "\n" * block.group().count("\n"), source)
    for number, line in enumerate(prose.splitlines(), 1):
        if line.strip():
            yield Text(path, number, line)


def marked(path: Path, source: str, comment: re.Pattern[str]) -> Iterator[Text]:
    """Yield the comments of a source file that is not Python."""
    for found in comment.finditer(source):
        text = next((group for group in found.groups() if group), "")
        yield Text(path, source.count("\n", 0, found.start()) + 1, " ".join(text.replace("*", " ").split()))


def texts() -> dict[str, list[Text]]:
    """Return all prose of the repository by its kind."""
    listed = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    kinds: dict[str, list[Text]] = {
        name: [] for name in ("docstrings", "comments", "errors, logs and help", "documents", ".proto", "web")
    }
    for name in listed.stdout.splitlines():
        path = Path(name)
        if not (ROOT / path).is_file() or path.name.endswith("_pb2.py"):
            continue
        if path not in PROGRAMS and path.suffix not in (".py", ".md", ".proto", ".ts", ".tsx", ".css"):
            continue
        source = (ROOT / path).read_text(encoding="utf-8")
        if path in PROGRAMS or (path.suffix == ".py" and path.parts[0] in PACKAGES):
            tree = ast.parse(source)
            kinds["docstrings"] += docstrings(path, tree)
            kinds["comments"] += comments(path, source)
            kinds["errors, logs and help"] += messages(path, tree)
        elif path.suffix == ".md":
            kinds["documents"] += documents(path, source)
        elif path.suffix == ".proto":
            kinds[".proto"] += marked(path, source, PROTO_COMMENT)
        elif path.suffix in (".ts", ".tsx", ".css") and path.parts[0] == "web":
            kinds["web"] += marked(path, source, WEB_COMMENT)
    return kinds


# Kind of text: the highest share of docstrings with a question word (%), and of idioms in 1,000 words.
LIMITS = {
    "docstrings": (2.0, 2.0),
    "comments": (0.0, 2.0),
    "errors, logs and help": (0.0, 2.0),
    "documents": (0.0, 2.0),
    ".proto": (0.0, 2.0),
    "web": (0.0, 2.0),
}


def main(arguments: list[str]) -> int:
    """Print the figures of each kind of text; return 1 if one is above its limit."""
    most = int(arguments[1]) if arguments[:1] == ["--list"] else 0
    above = False
    for kind, found in texts().items():
        share = 100 * sum(each.asks for each in found) / max(1, len(found))
        rate = 1000 * sum(len(each.idioms) for each in found) / max(1, sum(each.words for each in found))
        over = share > LIMITS[kind][0] or rate > LIMITS[kind][1]
        above |= over
        print(
            f"{kind}: {sum(each.words for each in found)} words, {share:.1f} % begin with a question word, "
            f"{rate:.1f} idioms in 1,000{' (too many)' if over else ''}"
        )
        worst = sorted(found, key=lambda each: -(len(each.idioms) + each.asks))[:most]
        for each in worst:
            if each.idioms or each.asks:
                print(f"    {each.path}:{each.line}: {' '.join(each.prose.split())[:120]}")
    if above:
        print("write it plainly (CONTRIBUTING.md, Prose): check_prose.py --list 40 names the places")
    return int(above)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
