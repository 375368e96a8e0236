"""Expected refusals, compared by code and parameters instead of by sentence."""

import pytest

from robomesh.errors import RefusedError
from robomesh.reasons import Code


def refused(code: Code, **values: str):
    """Return a context manager that expects a refusal with this code and these formatted parameters."""

    def matches(error: RefusedError) -> bool:
        return error.reason.code == code.name and values.items() <= dict(error.reason.values).items()

    return pytest.raises(RefusedError, check=matches)
