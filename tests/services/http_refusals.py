"""Refusals over HTTP, as a client reads them."""

import json
import re
from collections.abc import Mapping

from robomesh.reasons import Reason, pairs_of, reason_of


def read_refusal(headers: Mapping[str, str], body: bytes) -> Reason:
    """Return the reason of a refused request: from JSON, or from the content type of a text."""
    kind = headers["content-type"]
    if kind == "application/json":
        answer = json.loads(body)
        refusal = answer["refusal"]
        assert refusal["text"] == answer["text"]
        return Reason(refusal["code"], refusal["values"], (), refusal["text"])
    found = re.fullmatch(r'text/plain; charset=utf-8; refusal="([^"\\]*)"', kind)
    assert found, kind
    reason = reason_of(pairs_of(found[1]), body.decode())
    assert reason is not None
    return reason
