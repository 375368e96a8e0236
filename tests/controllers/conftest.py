"""Fixtures of the drivers' tests."""

from tests.protocol_gateway.conftest import mesh

__all__ = ["mesh"]
