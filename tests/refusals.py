"""Expected refusals, compared by code and parameters instead of by sentence."""

from collections.abc import Iterator

import pytest

from robomesh.errors import RefusedError
from robomesh.reasons import Code, Reason


def refused(code: Code, **values: str):
    """Return a context manager that expects a refusal with this code and these formatted parameters.

    The code may also be the one of a cause: the outermost code often only names the request.
    """

    def matches(error: RefusedError) -> bool:
        return any(
            each.code == code.name and values.items() <= dict(each.values).items()
            for each in _with_causes(error.reason)
        )

    return pytest.raises(RefusedError, check=matches)


def _with_causes(reason: Reason) -> Iterator[Reason]:
    yield reason
    for cause in reason.causes:
        yield from _with_causes(cause)
