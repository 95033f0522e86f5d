"""Firefox, driven through Marionette, the remote protocol that is built into it."""

import json
import os
import socket
import subprocess
import time
from pathlib import Path
from typing import Any

PREFERENCES = {
    "marionette.port": 0,
    "webgl.force-enabled": True,
    "browser.shell.checkDefaultBrowser": False,
    "datareporting.policy.dataSubmissionEnabled": False,
    "toolkit.telemetry.enabled": False,
    "app.update.enabled": False,
    "network.captive-portal-service.enabled": False,
}
"""Port 0 lets Firefox choose one, which it writes into its profile."""
PATIENCE = 120.0
"""Seconds until it must have started."""


class Firefox:
    """One window of a running Firefox.

    Parameters
    ----------
    program
        The executable.
    profile
        An empty folder.
    display
        Of X, like ``:0``.
    """

    def __init__(self, program: str, profile: Path, display: str) -> None:
        lines = [f"user_pref({json.dumps(k)}, {json.dumps(v)});" for k, v in PREFERENCES.items()]
        (profile / "user.js").write_text("\n".join(lines), encoding="utf-8")
        command = [program, "--marionette", "--no-remote", "--profile", str(profile)]
        self.process = subprocess.Popen(
            command,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            env={**os.environ, "DISPLAY": display, "LIBGL_ALWAYS_SOFTWARE": "1"},
        )
        self.socket = socket.create_connection(("127.0.0.1", self._port(profile)), PATIENCE)
        self.count = 0
        self._read()
        self.send("WebDriver:NewSession", {"pageLoadStrategy": "eager"})

    def _port(self, profile: Path) -> int:
        file, end = profile / "MarionetteActivePort", time.monotonic() + PATIENCE
        while not (file.is_file() and file.read_text()):
            assert time.monotonic() < end, "Firefox has not started"
            time.sleep(0.1)
        return int(file.read_text())

    def _read(self) -> Any:
        """One message: its length, a colon, JSON."""
        length = b""
        while (digit := self.socket.recv(1)) != b":":
            assert digit, "Firefox has ended"
            length += digit
        data = b""
        while len(data) < int(length):
            data += self.socket.recv(int(length) - len(data))
        return json.loads(data)

    def send(self, command: str, arguments: dict[str, Any]) -> Any:
        """Result of a command of WebDriver."""
        self.count += 1
        data = json.dumps([0, self.count, command, arguments]).encode()
        self.socket.sendall(b"%d:%s" % (len(data), data))
        _, number, error, result = self._read()
        assert number == self.count
        assert error is None, error
        return result

    def open(self, address: str) -> None:
        """Open a page and wait until its program says that it has begun, or failed."""
        self.send("WebDriver:Navigate", {"url": address})
        end = time.monotonic() + PATIENCE
        while not self("document.documentElement.dataset.ready"):
            assert not (failed := self("document.documentElement.dataset.failed")), failed
            assert time.monotonic() < end, "the page has not begun"
            time.sleep(0.1)

    def __call__(self, script: str, *arguments: Any) -> Any:
        """Value of an expression of the page; `explorer` is the running program."""
        given = {"script": f"return {script}", "args": list(arguments), "sandbox": None}
        return self.send("WebDriver:ExecuteScript", given)["value"]

    def press(self, *keys: str) -> None:
        """Press and release keys, one after the other."""
        acts = [{"type": kind, "value": key} for key in keys for kind in ("keyDown", "keyUp")]
        self.send("WebDriver:PerformActions", {"actions": [
            {"type": "key", "id": "keys", "actions": acts}]})  # fmt: skip

    def drag(self, places: list[tuple[float, float]]) -> None:
        """Press the mouse at the first place, move over the others, and release it there."""
        moves = [{"type": "pointerMove", "x": round(x), "y": round(y), "duration": 0}
                 for x, y in places]  # fmt: skip
        down, up = ({"type": f"pointer{what}", "button": 0} for what in ("Down", "Up"))
        acts = [moves[0], down, *moves[1:], up]
        self.send("WebDriver:PerformActions", {"actions": [
            {"type": "pointer", "id": "mouse", "actions": acts}]})  # fmt: skip

    def close(self) -> None:
        """End the program."""
        self.send("Marionette:Quit", {"flags": ["eForceQuit"]})
        self.socket.close()
        self.process.wait(PATIENCE)
