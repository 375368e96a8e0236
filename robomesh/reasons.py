"""Reasons for refused requests, ended leases and unchecked motions.

A reason is a code with parameters for programs and translations, and one English sentence for people. All
codes and sentences are in `robomesh.reason_codes`, and in `controllers.<kind>.codes`.

A refusal is an error reply: its payload is the sentence, its encoding is `text/plain;<parameters>`. The
parameters are a query string (`code=lease.held&holder=li`). A cause follows with the prefix `cause.`
(`cause.code=link.no_answer&cause.where=...`). Zenoh 1.10.2 ends the session of a peer that sends more than
255 bytes there, so a parameter that does not fit is left out; the code always fits.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from string import Formatter
from urllib.parse import parse_qsl, quote

from robomesh.texts import one_line

MOST_PARAMETER_BYTES = 255
"""Most bytes of an encoding's parameters."""

RETRY = ("busy", "again_s")
"""Parameters before the code: the request may be repeated, immediately or after a time [s]."""

_CODE = "code"
_CAUSE = "cause"
_LONGEST = 800
_SAFE = " ,:'\"()[]<>/"
_FORMATTER = Formatter()


@dataclass(frozen=True, slots=True)
class Reason:
    """A code with its parameters.

    Attributes:
        code: Code from the table, or of a newer peer: "lease.held".
        values: The parameters, as text.
        causes: Reasons for this reason; their sentences replace `{cause}` in its sentence.
        text: The sentence in English, without a full stop; for a received refusal its payload.
    """

    code: str
    values: Mapping[str, str] = field(default_factory=dict)
    causes: tuple["Reason", ...] = ()
    text: str = ""

    def __str__(self) -> str:
        return self.text


@dataclass(frozen=True, slots=True)
class Code:
    """A row of the table; calling it with parameters returns a reason.

    Attributes:
        name: The code: "lease.held".
        problem: Description of the problem with `{parameters}`, which may have a format: `{seconds:g}`.
        advice: What to do about it.
        chinese: Both in Chinese, of a kind of controllers; the page has that of all other codes.
    """

    name: str
    problem: str
    advice: str = ""
    chinese: str = ""

    @property
    def sentence(self) -> str:
        """The template of the sentence."""
        return f"{self.problem}: {self.advice}" if self.advice else self.problem

    @property
    def parameters(self) -> frozenset[str]:
        """Names in the sentence, including `cause`."""
        return frozenset(name for _, name, _, _ in _FORMATTER.parse(self.sentence) if name)

    def __call__(self, *causes: Reason, **values: object) -> Reason:
        """Return the reason.

        Raises:
            KeyError: If a parameter of the sentence is missing.
        """
        texts: dict[str, str] = {}
        parts: list[str] = []
        for literal, name, specification, _ in _FORMATTER.parse(self.sentence):
            parts.append(literal)
            if name == _CAUSE:
                parts.append("; ".join(cause.text for cause in causes))
            elif name:
                texts[name] = one_line(format(values[name], specification or ""), _LONGEST)
                parts.append(texts[name])
        for name in values.keys() - texts.keys():
            texts[name] = one_line(str(values[name]), _LONGEST)
        return Reason(self.name, texts, causes, "".join(parts))


def to_parameters(reason: Reason, when: str = "") -> str:
    """Return the parameters of a refusal's encoding, at most 255 bytes of ASCII.

    Args:
        when: Parameter before the code: the request may be repeated, and when.
    """
    written = f"{when}&" if when else ""
    written += f"{_CODE}={quote(reason.code, safe='')[: MOST_PARAMETER_BYTES // 3]}"
    for name, value in _flat(reason):
        pair = f"&{quote(name, safe='')}={quote(value, safe=_SAFE)}"
        if len(written) + len(pair) <= MOST_PARAMETER_BYTES:
            written += pair
    return written


def _flat(reason: Reason, prefix: str = "") -> list[tuple[str, str]]:
    pairs = [(f"{prefix}{name}", value) for name, value in reason.values.items()]
    # One of several causes would say less than the sentence, which has all of them.
    for cause in reason.causes if len(reason.causes) == 1 else ():
        pairs += [(f"{prefix}{_CAUSE}.{_CODE}", cause.code), *_flat(cause, f"{prefix}{_CAUSE}.")]
    return pairs


def pairs_of(parameters: str) -> dict[str, str]:
    """Return the parameters of a refusal's encoding; empty if it is not a query string."""
    try:
        return dict(parse_qsl(parameters[:MOST_PARAMETER_BYTES], keep_blank_values=True))
    except ValueError:
        return {}


def reason_of(pairs: Mapping[str, str], text: str) -> Reason | None:
    """Return the reason of a refusal; None: the encoding has no code.

    Args:
        pairs: Parameters of the refusal's encoding.
        text: The refusal's payload.
    """
    if not pairs.get(_CODE):
        return None
    prefix = f"{_CAUSE}."
    of_cause = {name.removeprefix(prefix): value for name, value in pairs.items() if name.startswith(prefix)}
    values = {
        name: value
        for name, value in pairs.items()
        if name not in (_CODE, *RETRY) and not name.startswith(prefix)
    }
    cause = reason_of(of_cause, "")
    return Reason(pairs[_CODE], values, () if cause is None else (cause,), text)
