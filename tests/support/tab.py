"""A tab of a headless Chromium that a test drives over DevTools: types, presses keys, looks, in real time."""

from __future__ import annotations

import base64
import contextlib
import io
import itertools
import json
import subprocess
import time
import urllib.request
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from websockets.sync.client import ClientConnection, connect

from tests.support.chromium import OPTIONS, Chromium

KEYS = {"Enter": ("Enter", 13, "\r"), "Space": (" ", 32, " "), "Tab": ("Tab", 9, ""), "Escape": ("Escape", 27, "")}
PATIENCE = 90.0
"""Seconds; a busy machine draws a frame in one."""


class Tab:
    """One page. What it complains about on the console is kept in `complaints`."""

    def __init__(self, socket: ClientConnection) -> None:
        self._socket = socket
        self._numbers = itertools.count(1)
        self.complaints: list[str] = []
        for domain in ("Page", "Runtime", "Log"):
            self.call(f"{domain}.enable")

    def call(self, method: str, **options: object) -> dict[str, Any]:
        """Result of a DevTools command."""
        number = next(self._numbers)
        self._socket.send(json.dumps({"id": number, "method": method, "params": options}))
        while True:
            message = json.loads(self._socket.recv(PATIENCE))
            self._note(message)
            if message.get("id") == number:
                assert "error" not in message, (method, message["error"])
                return message["result"]

    def _note(self, message: dict[str, Any]) -> None:
        told = message.get("params", {})
        if message.get("method") == "Runtime.exceptionThrown":
            self.complaints.append(told["exceptionDetails"].get("exception", {}).get("description", "an exception"))
        if message.get("method") == "Log.entryAdded" and told["entry"]["level"] in ("error", "warning"):
            self.complaints.append(told["entry"]["text"])
        if message.get("method") == "Runtime.consoleAPICalled" and told["type"] in ("error", "warning"):
            self.complaints.append(" ".join(str(a.get("value", a.get("description"))) for a in told["args"]))

    def go(self, url: str, *, before: str = "") -> None:
        """Open an address; the script `before` runs ahead of the page's own."""
        script = self.call("Page.addScriptToEvaluateOnNewDocument", source=before)
        self.call("Page.navigate", url="about:blank")  # or an address that differs in its fragment alone loads nothing
        self.call("Page.navigate", url=url)
        self.wait("document.readyState === 'complete' && document.body.dataset.ready")
        self.call("Page.removeScriptToEvaluateOnNewDocument", **script)

    def ask(self, expression: str) -> Any:
        """The value of an expression of JavaScript, awaited if it is a promise."""
        answer = self.call("Runtime.evaluate", expression=expression, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def wait(self, expression: str) -> Any:
        """The value of an expression, as soon as it is true."""
        deadline = time.monotonic() + PATIENCE
        while not (value := self.ask(expression)):
            assert time.monotonic() < deadline, (expression, self.data, self.ask("document.body.innerText"))
            time.sleep(0.05)
        return value

    @property
    def data(self) -> dict[str, str]:
        """`document.body.dataset`."""
        return self.ask("({...document.body.dataset})")

    def text(self, element: str) -> str:
        """Text of an element."""
        return self.ask(f"document.getElementById({element!r}).textContent")

    def click(self, element: str) -> None:
        """Click the middle of an element with the mouse."""
        box = self.ask(f"document.getElementById({element!r}).getBoundingClientRect().toJSON()")
        x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        for kind in ("mousePressed", "mouseReleased"):
            self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)

    def type(self, text: str, element: str | None = None) -> None:
        """Type into an element, or where the focus is; in place of what stands there."""
        if element:
            self.ask(f"document.getElementById({element!r}).focus() || document.activeElement.select?.()")
        self.call("Input.insertText", text=text)

    def press(self, name: str) -> None:
        """Press a key and let it go: one of `KEYS`, or a letter."""
        key, code, text = KEYS.get(name, (name, ord(name[0].upper()), name))
        for kind in ("keyDown", "keyUp"):
            options = {"text": text} if text and kind == "keyDown" else {}
            self.call("Input.dispatchKeyEvent", type=kind, key=key, windowsVirtualKeyCode=code, **options)

    def size(self, width: int, height: int, *, phone: bool = False) -> None:
        """Make the window so large."""
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=phone)

    def prefer(self, scheme: str) -> None:
        """`light` or `dark`, as a person sets it in the browser."""
        self.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])

    def png(self) -> bytes:
        """A screenshot as PNG."""
        return base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"])

    def picture(self) -> NDArray[np.int64]:
        """A screenshot, (H, W, 3)."""
        with Image.open(io.BytesIO(self.png())) as image:
            return np.asarray(image.convert("RGB")).astype(np.int64)


@contextlib.contextmanager
def open_tab(chromium: Chromium) -> Iterator[Tab]:
    """A tab of a browser of its own, which ends with the block."""
    profile = chromium.folder / "profile"
    command = [chromium.program, *OPTIONS, "--remote-debugging-port=0", f"--user-data-dir={profile}", "about:blank"]
    log = (chromium.folder / "chromium.log").open("wb")
    with log, subprocess.Popen(command, stdout=log, stderr=log) as process:
        try:
            port = _port(profile / "DevToolsActivePort", process)
            with urllib.request.urlopen(f"http://127.0.0.1:{port}/json/list", timeout=PATIENCE) as answer:
                page = next(each for each in json.load(answer) if each["type"] == "page")
            with connect(page["webSocketDebuggerUrl"], max_size=2**26, compression=None) as socket:
                yield Tab(socket)
        finally:
            process.terminate()


def _port(path: Any, process: subprocess.Popen[bytes]) -> int:
    deadline = time.monotonic() + PATIENCE
    while not (path.exists() and (lines := path.read_text().split())):
        assert time.monotonic() < deadline, "the browser does not start"
        assert process.poll() is None, "the browser ended"
        time.sleep(0.05)
    return int(lines[0])
