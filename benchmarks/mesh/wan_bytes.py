"""The bytes on the line between a plant and a hub, for `wan`: a topic at a time, by TLS, past a border."""

import contextlib
import subprocess
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from benchmarks.harness.sites import ROBOMESH
from tests.wan.network import Link, Network
from tests.wan.sites import ARM, PORT, Probe, Site

_OF_ARM = "robomesh/plant/arm/{}"
_WATCHED = ("joints", "joints/slow", "controller", "frames", "kinematics", "video/far")


def bytes_per_topic(seconds: float) -> dict[str, Any]:
    """Measure each topic for one monitor, and two of the topics by TLS."""
    rows: dict[str, Any] = {}
    for topic in ("", "joints", "joints/slow", "controller", "frames", "kinematics"):
        with _stage((topic,) if topic else ()) as far:
            rows[topic or "nothing watched"] = _crossed(far, seconds)
    for topic in ("", "joints"):
        with _stage((topic,) if topic else (), border="open") as far:
            rows[f"{topic or 'nothing watched'}, TLS"] = _crossed(far, seconds)
    return rows


def over_border(seconds: float) -> dict[str, Any]:
    """Measure all that a monitor at the hub requests of one robot, and its far view alone."""
    rows: dict[str, Any] = {}
    for name, watched, border in (
        ("all, border open", _WATCHED, "open"),
        ("all, border slow", _WATCHED, "slow"),
        ("video/far alone", ("video/far",), "slow"),
    ):
        with _stage(watched, border=border) as far:
            rows[name] = _crossed(far, seconds)
    return rows


def _crossed(far: Link, seconds: float) -> dict[str, Any]:
    before, began = far.counters(), time.monotonic()
    time.sleep(seconds)
    after, passed = far.counters(), time.monotonic() - began
    return {
        way: {
            "bytes_per_s": round((after[way]["bytes"] - before[way]["bytes"]) / passed),
            "packets_per_s": round((after[way]["packets"] - before[way]["packets"]) / passed, 1),
        }
        for way in ("forth", "back")
    }


@contextlib.contextmanager
def _stage(topics: tuple[str, ...], *, border: str = "") -> Iterator[Link]:
    """Start a plant with a moving arm, watched from the hub; by TLS if its border is given."""
    with tempfile.TemporaryDirectory() as folder, Network() as network:
        plant_host, hub_host = network.host("plant"), network.host("hub")
        far = network.link(plant_host, hub_host)
        at_hub = f"tcp/{far.far}:{PORT}"
        hub = Site(hub_host, "hub", Path(folder) / "hub")
        plant = Site(plant_host, "plant", Path(folder) / "plant", links=(at_hub,), more=ARM)
        keys: tuple[Path | None, ...] = (None, None)
        router = f"tcp/127.0.0.1:{PORT}"
        if border:
            keys, router = _with_keys(plant, hub, f"tls/{far.far}:{PORT}", border), f"tls/127.0.0.1:{PORT}"
        hub.start("router")
        near = plant.with_arm(moving=True, keys=keys[0], connect=router)
        if {"frames", "kinematics", "video/far"} & set(topics):
            plant.start("kinematics")
        if "video/far" in topics:
            plant.start("renderer")
        joints = _OF_ARM.format("joints")
        near.do("watch", joints)
        near.until(joints, stale=False, within_s=90.0)
        room = Probe(hub_host, router, keys[1])
        for topic in topics:
            room.do("watch", _OF_ARM.format(topic))
        for topic in topics:
            if border != "slow" or topic in ("joints/slow", "controller", "video/far"):
                room.until(_OF_ARM.format(topic), stale=False, within_s=90.0, stale_s=3.0)
        time.sleep(2.0)
        yield far


def _with_keys(plant: Site, hub: Site, at_hub: str, border: str) -> tuple[Path, Path]:
    """Make authorities, certificates and the link between both sites; return a monitor's keys at each."""
    plant.links = (f"hub={at_hub}",)
    plant.router = f'border = "{border}"'
    for site in (plant, hub):
        site.more = f'[keys]\nfolder = "keys"\n{site.more}'
        _keys(site, "init", str(site.file))
        _keys(site, "issue", "probe", "--role", "monitor")
    _keys(hub, "issue", "--guest", "plant", "--sites", "plant")
    guest = next((hub.folder / "keys").rglob("*plant*.pem"))
    _keys(plant, "accept", str(guest), "--sites", "hub")
    of_plant, of_hub = (next((site.folder / "keys").rglob("probe*.pem")) for site in (plant, hub))
    return of_plant, of_hub


def _keys(site: Site, *words: str) -> None:
    """Run `robomesh keys` at a site."""
    folder = () if words[0] == "init" else ("--folder", str(site.folder / "keys"))
    subprocess.run([*ROBOMESH, "keys", *words, *folder], check=True, stdout=subprocess.DEVNULL)
