"""Lichtblick 1.28, a viewer that others wrote, shows the arm as our kinematics and meshes say.

Its build is beside the project, in `../shared/lichtblick`; without it these tests are skipped.
"""

import functools
import http.server
import json
import re
import signal
import subprocess
import sys
import threading
import urllib.parse
from datetime import timedelta
from pathlib import Path

import cv2
import numpy as np
import pytest

import robomesh
from robots.descriptions.description import load
from robots.descriptions.glb import link_geometry
from robots.kinematics.kinematic_tree import tree_of
from robots.kinematics.model import build_model, link_placements
from services.viewers.layout import viewer_layout
from tests.browser.conftest import ARGUMENTS, CHROMIUM, LAUNCH_MS
from tests.compatibility.earlier import unpack
from tests.ports import free_port
from tests.site import running_site, wait_until

pytestmark = [pytest.mark.long, pytest.mark.browser, pytest.mark.processes]

BUILD = Path(__file__).parents[3] / "shared" / "lichtblick" / "lichtblick-1.28.1-web.tar.xz"
ARM = """
[[robot]]
name = "arm"
model = "pt600"
floor = false
"""
SHOWN_S = 120
# The camera of the test's layout.
DISTANCE_M, HEIGHT_M, POLAR, AZIMUTH, FIELD_OF_VIEW = 2.4, 0.5, 65.0, 45.0, 45.0


class Files(http.server.SimpleHTTPRequestHandler):
    """Files with byte ranges, which Lichtblick needs to open a recording."""

    protocol_version = "HTTP/1.1"

    def log_message(self, *_):
        pass

    def do_GET(self):
        path = Path(self.translate_path(self.path))
        wanted = re.fullmatch(r"bytes=(\d+)-(\d*)", self.headers.get("Range", ""))
        if not wanted or not path.is_file():
            super().do_GET()
            return
        size = path.stat().st_size
        begin, end = int(wanted[1]), min(int(wanted[2] or size - 1), size - 1)
        self.send_response(206)
        self.send_header("Content-Range", f"bytes {begin}-{end}/{size}")
        self.send_header("Content-Length", str(end - begin + 1))
        self.end_headers()
        with path.open("rb") as stream:
            stream.seek(begin)
            self.wfile.write(stream.read(end - begin + 1))

    def end_headers(self):
        self.send_header("Accept-Ranges", "bytes")
        super().end_headers()


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """Yield a site with an arm at rest."""
    if not BUILD.exists():
        pytest.skip("no Lichtblick beside the project (../shared/lichtblick)")
    with running_site(tmp_path_factory.mktemp("site"), robots=ARM) as running:
        with robomesh.connect(running.router, timeout_s=20.0) as mesh:
            robot = mesh.robot("arm")
            wait_until(lambda: robot.last("description") and robot.last("joints"))
        yield running


@pytest.fixture(scope="module")
def files(site, tmp_path_factory):
    """Yield a folder with Lichtblick and a layout of its 3-D panel, and the address that serves it."""
    folder = unpack(BUILD, tmp_path_factory.mktemp("lichtblick") / "viewer")
    with robomesh.connect(site.router, timeout_s=20.0) as mesh:
        layout = viewer_layout("test", "arm", mesh.robot("arm").description())
    scene = layout["configById"]["3D!arm"]
    scene["scene"] |= {"backgroundColor": "#ffffff"}
    scene["layers"] = {}
    scene["cameraState"] |= {
        "distance": DISTANCE_M,
        "targetOffset": [0, 0, HEIGHT_M],
        "phi": POLAR,
        "thetaOffset": AZIMUTH,
        "fovy": FIELD_OF_VIEW,
    }
    (folder / "layout.json").write_text(json.dumps(layout | {"layout": "3D!arm"}))
    server = http.server.ThreadingHTTPServer(
        ("127.0.0.1", 0), functools.partial(Files, directory=str(folder))
    )
    serving = threading.Thread(target=server.serve_forever)
    serving.start()
    yield folder, f"http://127.0.0.1:{server.server_port}"
    server.shutdown()
    serving.join()
    server.server_close()


def live(site, files):
    port = free_port()
    arguments = ("foxglove", "--connect", site.router, "--listen", f"127.0.0.1:{port}")
    bridge = subprocess.Popen([sys.executable, "-m", "services.command_line.main", *arguments])
    return bridge, {"ds": "foxglove-websocket", "ds.url": f"ws://127.0.0.1:{port}"}


def recorded(site, files):
    folder, address = files
    arguments = ("record", "arm", "--name", "still", "--view", "-", "--connect", site.router)
    with (
        robomesh.connect(site.router, timeout_s=20.0) as mesh,
        subprocess.Popen([sys.executable, "-m", "services.command_line.main", *arguments]) as recording,
    ):
        for state in mesh.robot("arm").topic("recording", on_stale="yield"):
            if state.message.open and state.message.duration.ToNanoseconds() > 2e9:
                break
        recording.send_signal(signal.SIGINT)
        assert recording.wait(60) == 0
        mesh.fetch_recording("still", folder / "recording.mcap")
        begun = mesh.open_recording("still").info.start
    # Lichtblick begins at the first message, which may be before the first frame.
    at = (begun + timedelta(seconds=1)).isoformat().replace("+00:00", "Z")
    return None, {"ds": "remote-file", "ds.url": f"{address}/recording.mcap", "time": at}


@pytest.mark.parametrize("source", [live, recorded])
def test_the_arm_has_the_silhouette_of_its_shapes_and_its_colours(site, files, source, tmp_path):
    from playwright.sync_api import sync_playwright

    bridge, parameters = source(site, files)
    try:
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(
                executable_path=str(CHROMIUM), args=ARGUMENTS, timeout=LAUNCH_MS
            )
            page = browser.new_page(viewport={"width": 1000, "height": 700})
            query = urllib.parse.urlencode({**parameters, "layoutUrl": f"{files[1]}/layout.json"})
            page.goto(f"{files[1]}/?{query}", wait_until="commit")
            shown = expected = None

            def alike():
                nonlocal shown, expected
                canvas = page.locator("canvas").first
                if canvas.count() == 0:
                    page.wait_for_timeout(500)
                    return False
                canvas.screenshot(path=tmp_path / "shown.png", timeout=LAUNCH_MS)
                shown = cv2.imread(str(tmp_path / "shown.png"))
                if expected is None or expected.shape != shown.shape[:2]:
                    expected = silhouette(site, *shown.shape[:2])
                cv2.imwrite(str(tmp_path / "expected.png"), expected * 255)
                return overlap(shown, expected) > 0.9

            wait_until(alike, SHOWN_S)
            browser.close()
    finally:
        if bridge is not None:
            bridge.terminate()
            bridge.wait(30)
    orange = (shown[:, :, 2] > 1.6 * shown[:, :, 0]) & (expected > 0)
    assert orange.sum() > 0.3 * expected.sum()


def overlap(shown, expected):
    """Return the share of the pixels of either silhouette that both have, without the panel's buttons."""
    inside = np.s_[10:-10, 10:-70]
    drawn, expected = shown[inside].min(axis=2) < 225, expected[inside] > 0
    return (drawn & expected).sum() / max((drawn | expected).sum(), 1)


def silhouette(site, height, width):
    """Return the pixels that the arm's meshes cover, by a projection of each triangle."""
    with robomesh.connect(site.router, timeout_s=20.0) as mesh:
        positions = mesh.robot("arm").last("joints").positions
    description = load("pt600")
    model = build_model(description)
    placements = dict(zip(model.link_names, link_placements(model, positions), strict=True))
    polar, azimuth = np.radians([POLAR, AZIMUTH])
    back = np.array([-np.sin(polar) * np.sin(azimuth), -np.sin(polar) * np.cos(azimuth), np.cos(polar)])
    right = np.cross([0.0, 0.0, 1.0], back)
    right /= np.linalg.norm(right)
    camera = np.array([right, np.cross(back, right), back])
    eye = np.array([0.0, 0.0, HEIGHT_M]) + DISTANCE_M * back
    scale = height / 2 / np.tan(np.radians(FIELD_OF_VIEW / 2))
    picture = np.zeros((height, width), dtype=np.uint8)
    for link in tree_of(description).links:
        if not link.shapes:
            continue
        for part in link_geometry(link.shapes).parts:
            world = part.vertices @ placements[link.name][:3, :3].T + placements[link.name][:3, 3]
            x, y, z = ((world - eye) @ camera.T).T
            pixels = np.stack([width / 2 - scale * x / z, height / 2 + scale * y / z], axis=1)
            for corners in np.round(pixels[part.triangles]).astype(np.int32):
                cv2.fillConvexPoly(picture, corners, 1)
    return picture
