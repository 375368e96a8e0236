"""A Firefox of the system, driven by WebDriver BiDi: Playwright drives only its own build of Firefox."""

import base64
import itertools
import json
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from websockets.sync.client import ClientConnection, connect

from tests.ports import free_port

STARTED_S = 120.0
ANSWERED_S = 60.0
# Nothing leaves this machine: all other addresses go to a proxy that does not exist.
PREFERENCES = {
    "app.update.auto": False,
    "browser.shell.checkDefaultBrowser": False,
    "browser.startup.page": 0,
    "datareporting.policy.dataSubmissionEnabled": False,
    "intl.accept_languages": "en-GB",
    "network.captive-portal-service.enabled": False,
    "network.connectivity-service.enabled": False,
    "network.proxy.allow_hijacking_localhost": False,
    "network.proxy.http": "127.0.0.1",
    "network.proxy.http_port": 9,
    "network.proxy.ssl": "127.0.0.1",
    "network.proxy.ssl_port": 9,
    "network.proxy.type": 1,
    "webgl.force-enabled": True,
}


class Firefox:
    """One window of a running Firefox."""

    def __init__(self, connection: ClientConnection) -> None:
        self._connection = connection
        self._ids = itertools.count(1)
        self.errors: list[str] = []
        self.send("session.new", {"capabilities": {}})
        self._context = self.send("browsingContext.getTree", {})["contexts"][0]["context"]
        self.send("session.subscribe", {"events": ["log.entryAdded"]})

    def send(self, method: str, params: dict[str, Any]) -> dict[str, Any]:
        """Send a command and return its result; take the events that arrive before it."""
        own = next(self._ids)
        self._connection.send(json.dumps({"id": own, "method": method, "params": params}))
        while True:
            message = json.loads(self._connection.recv(timeout=ANSWERED_S))
            if message.get("method") == "log.entryAdded" and message["params"]["level"] == "error":
                self.errors.append(message["params"]["text"])
            if message.get("id") == own:
                assert message["type"] == "success", message
                result: dict[str, Any] = message["result"]
                return result

    def resize(self, width: int, height: int) -> None:
        viewport = {"width": width, "height": height}
        self.send("browsingContext.setViewport", {"context": self._context, "viewport": viewport})

    def open(self, address: str) -> None:
        # Otherwise only the address's fragment changes.
        for url in ("about:blank", address):
            self.send("browsingContext.navigate", {"context": self._context, "url": url, "wait": "complete"})

    def evaluate(self, expression: str) -> Any:
        """Return an expression's value, which is a text, a number, a truth value or nothing."""
        answer = self.send(
            "script.evaluate",
            {"expression": expression, "target": {"context": self._context}, "awaitPromise": True},
        )
        assert answer["type"] == "success", answer
        return answer["result"].get("value")

    def wait(self, expression: str, timeout_s: float = 60.0) -> Any:
        """Wait until an expression is true, and return it."""
        deadline = time.monotonic() + timeout_s
        while not (value := self.evaluate(expression)):
            assert time.monotonic() < deadline, f"{expression} does not come true; {self.errors}"
            time.sleep(0.1)
        return value

    def click(self, expression: str) -> None:
        """Press and release the mouse on an element."""
        self.wait(f"{expression}?.scrollIntoView({{ block: 'center' }}) === undefined && !!{expression}")
        box = f"{expression}.getBoundingClientRect()"
        x, y = (
            round(self.evaluate(f"{box}.{of[0]} + {box}.{of[1]} / 2"))
            for of in (("left", "width"), ("top", "height"))
        )
        actions = [
            {"type": "pointerMove", "x": x, "y": y},
            {"type": "pointerDown", "button": 0},
            {"type": "pointerUp", "button": 0},
        ]
        source = {"type": "pointer", "id": "mouse", "actions": actions}
        self.send("input.performActions", {"context": self._context, "actions": [source]})

    def type(self, text: str) -> None:
        """Press keys."""
        actions = [{"type": kind, "value": key} for key in text for kind in ("keyDown", "keyUp")]
        source = {"type": "key", "id": "keys", "actions": actions}
        self.send("input.performActions", {"context": self._context, "actions": [source]})

    def screenshot(self, path: Path) -> None:
        found = self.send("browsingContext.captureScreenshot", {"context": self._context})
        path.write_bytes(base64.b64decode(found["data"]))


@contextmanager
def running_firefox(program: str, folder: Path) -> Iterator[Firefox]:
    """Run a headless Firefox with a profile in a folder."""
    profile = folder / "profile"
    profile.mkdir()
    lines = (f"user_pref({json.dumps(name)}, {json.dumps(value)});" for name, value in PREFERENCES.items())
    (profile / "user.js").write_text("\n".join(lines))
    port = free_port()
    process = subprocess.Popen(
        [
            program,
            "--headless",
            "--no-remote",
            "--profile",
            str(profile),
            "--remote-debugging-port",
            str(port),
        ],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        _wait_until_listening(process, port)
        with connect(f"ws://127.0.0.1:{port}/session", max_size=None, proxy=None) as connection:
            yield Firefox(connection)
    finally:
        process.terminate()
        with suppress(subprocess.TimeoutExpired):
            process.wait(20.0)
        process.kill()
        process.wait()


def _wait_until_listening(process: subprocess.Popen[bytes], port: int) -> None:
    deadline = time.monotonic() + STARTED_S
    while True:
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)) == 0:
                return
        assert process.poll() is None, "Firefox ended as it started"
        assert time.monotonic() < deadline, "Firefox does not accept connections"
        time.sleep(0.2)
