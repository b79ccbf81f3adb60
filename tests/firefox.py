"""Debian's Firefox over WebDriver BiDi, for what the pages have to do in another browser than
Chromium.

Firefox speaks it by itself: neither a driver nor a download is needed.
"""

from __future__ import annotations

import itertools
import json
import re
import shutil
import subprocess
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from websockets.sync.client import ClientConnection, connect

from tests.clients.browser_pages import PLACE

FIREFOX = shutil.which("firefox-esr") or shutil.which("firefox")
NEEDS_FIREFOX = [
    pytest.mark.system,
    pytest.mark.firefox,
    pytest.mark.skipif(FIREFOX is None, reason="needs Firefox (Debian's firefox-esr) on the PATH"),
]
SIZE = {"width": 1300, "height": 900}
KEYS = {"Control": "\ue009", "Shift": "\ue008", "Enter": "\ue007", "Delete": "\ue017"}
_ADDRESS = re.compile(r"WebDriver BiDi listening on (ws://\S+)")
_WITHIN_S = 120.0
_PREFERENCES = {
    "intl.accept_languages": "en-US",
    "browser.download.folderList": 2,  # the folder named by browser.download.dir
    "browser.download.useDownloadDir": True,
    "browser.download.always_ask_before_handling_new_types": False,
}


class Refused(AssertionError):
    """A command that Firefox does not carry out, or a script that throws."""


class Firefox:
    """One tab; ``errors`` are those of its console, and answers of 400 and above, so far."""

    def __init__(
        self, socket: ClientConnection, downloads: Path, process: subprocess.Popen[str]
    ) -> None:
        self._socket = socket
        self._process = process
        self._downloads = downloads
        self._ids = itertools.count(1)
        self.errors: list[str] = []
        self.call("session.new", capabilities={})
        self.call("session.subscribe", events=["log.entryAdded", "network.responseCompleted"])
        self._tab = self.call("browsingContext.getTree")["contexts"][0]["context"]
        self.call("browsingContext.setViewport", context=self._tab, viewport=SIZE)

    def crash(self) -> None:
        """Ends at once, without a chance to put anything away."""
        self._process.kill()
        self._process.wait()

    def call(self, method: str, **params: Any) -> Any:
        """The result of a command; raises Refused with what Firefox says, TimeoutError where it says
        nothing."""
        number = next(self._ids)
        until = time.monotonic() + _WITHIN_S
        self._socket.send(json.dumps({"id": number, "method": method, "params": params}))
        while True:
            message = json.loads(self._socket.recv(timeout=max(0.0, until - time.monotonic())))
            self._note(message.get("method"), message.get("params", {}))
            if message.get("id") == number:
                if message["type"] != "success":
                    raise Refused(message)
                return message["result"]

    def _note(self, event: str | None, params: dict[str, Any]) -> None:
        if event == "log.entryAdded" and params["level"] == "error":
            self.errors.append(params["text"])
        elif event == "network.responseCompleted" and params["response"]["status"] >= 400:
            self.errors.append(f"{params['response']['status']} {params['response']['url']}")

    def open(self, address: str) -> None:
        self.call("browsingContext.navigate", context=self._tab, url=address, wait="complete")

    def reload(self) -> None:
        self.call("browsingContext.reload", context=self._tab, wait="complete")

    def evaluate(self, script: str) -> Any:
        """The value of an expression in the page, by way of JSON."""
        target = {"context": self._tab}
        whole = f"(async () => JSON.stringify(await ({script})) ?? 'null')()"
        found = self.call("script.evaluate", expression=whole, target=target, awaitPromise=True)
        if found["type"] != "success":
            raise Refused(found)
        return json.loads(found["result"]["value"])

    def wait_for(self, script: str) -> None:
        """Until the expression is true. While another page comes there may be nobody to ask."""
        until = time.monotonic() + _WITHIN_S
        while not self._evaluated(script):
            assert time.monotonic() < until, f"{script} is not true; errors: {self.errors}"
            time.sleep(0.05)

    def _evaluated(self, script: str) -> Any:
        try:
            return self.evaluate(script)
        except Refused:
            return None

    def upload(self, selector: str, *files: Path) -> None:
        """Chooses files for an input, as a person does in the dialog."""
        found = self.call(
            "browsingContext.locateNodes",
            context=self._tab,
            locator={"type": "css", "value": selector},
        )
        element = {"sharedId": found["nodes"][0]["sharedId"]}
        self.call(
            "input.setFiles",
            context=self._tab,
            element=element,
            files=[str(file) for file in files],
        )

    def click(self, selector: str) -> None:
        """A real click in the middle of an element; one that something else covers gets none."""
        script = f"""(() => {{
            const element = document.querySelector({json.dumps(selector)});
            element.scrollIntoView({{ block: "nearest" }});
            const box = element.getBoundingClientRect();
            return [box.left + box.width / 2, box.top + box.height / 2];
        }})()"""
        self._click_at(*self.evaluate(script))

    def click_picture(self, x: float, y: float) -> None:
        """On a point of the picture that the page shows."""
        self._click_at(*self.evaluate(f"({PLACE})([{x}, {y}])"))

    def _click_at(self, left: float, top: float) -> None:
        moves = [
            {"type": "pointerMove", "x": round(left), "y": round(top)},
            {"type": "pointerDown", "button": 0},
            {"type": "pointerUp", "button": 0},
        ]
        self._act({"type": "pointer", "id": "mouse", "actions": moves})

    def press(self, keys: str) -> None:
        """Keys as ``Control+z``."""
        values = [KEYS.get(key, key) for key in keys.split("+")]
        down = [{"type": "keyDown", "value": value} for value in values]
        up = [{"type": "keyUp", "value": value} for value in reversed(values)]
        self._act({"type": "key", "id": "keyboard", "actions": down + up})

    def _act(self, source: dict[str, Any]) -> None:
        self.call("input.performActions", context=self._tab, actions=[source])

    def downloaded(self, name: str) -> Path:
        """The file of this name, as soon as all of it is there."""
        file = self._downloads / name
        until = time.monotonic() + _WITHIN_S
        while not file.exists() or not file.stat().st_size or list(self._downloads.glob("*.part")):
            assert time.monotonic() < until, f"{name} was not downloaded; errors: {self.errors}"
            time.sleep(0.05)
        return file


@contextmanager
def firefox(folder: Path) -> Iterator[Firefox]:
    """A headless Firefox in English, with its profile in this folder, which may be there already,
    and its downloads."""
    assert FIREFOX is not None
    profile, downloads = folder / "profile", folder / "downloads"
    for made in (profile, downloads):
        made.mkdir(exist_ok=True)
    preferences = _PREFERENCES | {"browser.download.dir": str(downloads)}
    lines = [
        f"user_pref({json.dumps(name)}, {json.dumps(value)});\n"
        for name, value in preferences.items()
    ]
    (profile / "user.js").write_text("".join(lines))
    command = [
        FIREFOX,
        "--headless",
        "--no-remote",
        "--profile",
        str(profile),
        "--remote-debugging-port",
        "0",
    ]
    process = subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    )
    try:
        with connect(f"{_address(process)}/session", max_size=None) as socket:
            yield Firefox(socket, downloads, process)
    finally:
        process.terminate()
        try:
            process.wait(timeout=20)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def _address(process: subprocess.Popen[str]) -> str:
    """Where it listens. What it says later is read, too, or it would wait for a reader; a Firefox
    that never listens is killed, and that is an AssertionError."""
    assert process.stderr is not None
    too_late = threading.Timer(_WITHIN_S, process.kill)
    too_late.start()
    found = next(filter(None, map(_ADDRESS.search, process.stderr)), None)
    too_late.cancel()
    assert found, f"Firefox did not listen within {_WITHIN_S:g} s"
    threading.Thread(target=process.stderr.read, daemon=True).start()
    return found[1]
