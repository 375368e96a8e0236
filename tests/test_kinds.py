"""Kinds of controllers: only their folders name them, and everything else runs without any of them."""

import re
import sys
from importlib.metadata import PackageNotFoundError
from pathlib import Path

import pytest

from controllers.probing import Probe
from protocol_gateway.configuration.kinds import kind_of, own_kinds, part_of
from protocol_gateway.seam.errors import GatewaySettingsError
from protocol_gateway.seam.simulated import Simulated

ROOT = Path(__file__).parents[1]
# Names of vendors, of their protocols, and of what reads them.
NAMES = re.compile(
    r"universal.?robots|yaskawa|motoman|fanuc|karel|\brtde\b|\bhses\b|\bsnpx\b|opc.?ua|asyncua", re.IGNORECASE
)
OUTSIDE = ("robomesh", "robots", "renderer", "protocol_gateway", "services", "web/src")


def test_nothing_outside_the_kinds_names_one():
    named = [
        f"{file.relative_to(ROOT)}: {found[0]}"
        for folder in OUTSIDE
        for ending in ("py", "ts", "tsx", "json", "proto", "css")
        for file in sorted((ROOT / folder).rglob(f"*.{ending}"))
        if not {"gen", "node_modules"} & {*file.parts} and (found := NAMES.search(file.read_text("utf-8")))
    ]
    assert named == []


def test_every_kind_has_all_its_parts():
    kinds = own_kinds()
    assert "unit" in kinds
    for protocol, each in kinds.items():
        assert each.driver_maker
        assert part_of(protocol, "simulated", Simulated)
        assert part_of(protocol, "probe", Probe)


def test_a_kind_whose_folder_is_missing_is_no_protocol(monkeypatch):
    others = own_kinds().keys() - {"snpx", "fanuc-ftp"}
    own_kinds.cache_clear()
    # As if it were not there: Python's own sign for it.
    monkeypatch.setitem(sys.modules, "controllers.fanuc", None)
    try:
        assert own_kinds().keys() == others
        with pytest.raises(GatewaySettingsError, match="unknown protocol 'snpx'; known: unit"):
            kind_of("snpx")
    finally:
        own_kinds.cache_clear()


def test_sources_that_are_not_installed_say_so(monkeypatch):
    def absent(name):
        raise PackageNotFoundError(name)

    own_kinds.cache_clear()
    monkeypatch.setattr("protocol_gateway.configuration.kinds.distribution", absent)
    try:
        with pytest.raises(GatewaySettingsError, match="install robomesh again"):
            own_kinds()
    finally:
        own_kinds.cache_clear()
