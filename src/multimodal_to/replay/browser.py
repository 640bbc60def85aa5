"""A headless Chromium that opens a page from disk and takes pictures of it, driven over its DevTools protocol."""

from __future__ import annotations

import base64
import json
import os
import shutil
import subprocess
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from http.client import HTTPConnection, HTTPException
from pathlib import Path
from typing import Any

from websockets.exceptions import WebSocketException
from websockets.sync.client import ClientConnection, connect

from multimodal_to import children
from multimodal_to.errors import OutputError, said
from multimodal_to.files.writing import scratch

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome", "msedge")
"""Programs that are looked for, in this order, where the environment's CHROME_PATH names none."""

_OPTIONS = (
    "--headless=new",
    "--no-first-run",
    "--hide-scrollbars",
    "--mute-audio",
    "--enable-unsafe-swiftshader",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-dev-shm-usage",
    "--remote-debugging-port=0",
    "--force-device-scale-factor=1",
)
_PATIENCE = 120.0  # [s]


def find_browser() -> str | None:
    """Return the path of a Chromium or Chrome; None where there is none."""
    named = os.environ.get("CHROME_PATH")
    return named or next(filter(None, map(shutil.which, BROWSERS)), None)


class Page:
    """An open page: JavaScript in it, pictures of it, and the errors that its console has shown."""

    def __init__(self, socket: ClientConnection) -> None:
        self._socket, self._count = socket, 0
        self.errors: list[str] = []
        self.requests: list[str] = []

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Call a method of the DevTools protocol and return its result."""
        self._count += 1
        self._socket.send(json.dumps({"id": self._count, "method": method, "params": parameters}))
        while True:
            message = json.loads(self._socket.recv(timeout=_PATIENCE))
            if message.get("id") == self._count:
                if "error" in message:
                    raise OutputError(f"the browser refused {method}: {message['error'].get('message')}")
                return dict(message["result"])
            self._note(message)

    def evaluate(self, expression: str) -> Any:
        """Return the value of a JavaScript expression in the page, awaited.

        Raises:
            OutputError: it threw.
        """
        result = self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in result:
            details = result["exceptionDetails"]
            raise OutputError(f"the page failed: {details.get('exception', {}).get('description', details['text'])}")
        return result["result"].get("value")

    def open(self, page: Path, fragment: str = "") -> None:
        """Open a page from disk, with networking off, and wait until its replay stands."""
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")
        self.call("Network.emulateNetworkConditions", offline=True, latency=0, downloadThroughput=0, uploadThroughput=0)
        self.call("Page.navigate", url=page.resolve().as_uri() + fragment)
        deadline = time.monotonic() + _PATIENCE
        while not self.evaluate("document.readyState === 'complete' && typeof replay === 'object'"):
            if self.errors:
                raise OutputError(f"the page failed: {self.errors[0]}")
            if time.monotonic() > deadline:
                raise OutputError(f"the page did not open within {_PATIENCE:.0f} s")
            time.sleep(0.05)

    def picture(self, form: str = "png") -> bytes:
        """Return what the page shows as a PNG or, for `jpeg`, as a JPEG of high quality."""
        options = {"quality": 92} if form == "jpeg" else {}
        shot = self.call("Page.captureScreenshot", format=form, **options)
        return base64.b64decode(shot["data"])

    def _note(self, message: dict[str, Any]) -> None:
        method, parameters = message.get("method"), message.get("params", {})
        if method == "Runtime.exceptionThrown":
            details = parameters["exceptionDetails"]
            self.errors.append(details.get("exception", {}).get("description", details["text"]))
        elif method == "Log.entryAdded" and parameters["entry"]["level"] == "error":
            self.errors.append(parameters["entry"]["text"])
        elif method == "Runtime.consoleAPICalled" and parameters["type"] == "error":
            self.errors.append(" ".join(str(part.get("value", part.get("description"))) for part in parameters["args"]))
        elif method == "Network.requestWillBeSent":
            self.requests.append(parameters["request"]["url"])


@contextmanager
def open_browser(size: tuple[int, int]) -> Iterator[Page]:
    """Start a headless browser whose page has a size [pixel], and end it.

    Raises:
        OutputError: there is no Chromium, or it does not start.
    """
    program = find_browser()
    if program is None:
        raise OutputError(
            "pictures and films need Chromium or Chrome, and none was found: install it (`apt-get install chromium`), "
            "or name its program in the environment variable CHROME_PATH"
        )
    with scratch() as profile:
        as_root = os.name == "posix" and os.geteuid() == 0  # for whom Chromium has no sandbox
        sandbox = ("--no-sandbox",) if as_root else ()
        window = f"--window-size={size[0]},{size[1]}"
        try:
            process = children.start(
                [program, *_OPTIONS, *sandbox, window, f"--user-data-dir={profile}", "about:blank"]
            )
        except OSError as error:
            raise OutputError(f"'{program}' does not start: {error.strerror or error}") from error
        try:
            address = _address(process, profile)
            with connect(address, max_size=None, open_timeout=_PATIENCE, proxy=None) as socket:
                page = Page(socket)
                page.call(
                    "Emulation.setDeviceMetricsOverride",
                    width=size[0],
                    height=size[1],
                    deviceScaleFactor=1,
                    mobile=False,
                )
                yield page
        except (WebSocketException, TimeoutError, ConnectionError) as error:
            raise OutputError(f"the browser '{program}' stopped answering: {said(error)}") from error
        finally:
            children.end(process)


def _address(process: subprocess.Popen[bytes], profile: Path) -> str:
    """Return the WebSocket address of the browser's first page, once it has one."""
    deadline = time.monotonic() + _PATIENCE
    while time.monotonic() < deadline:
        if process.poll() is not None:
            raise OutputError(f"the browser ended at once, with exit status {process.returncode}")
        with suppress(OSError, ValueError, IndexError, HTTPException):  # until it listens
            port = int((profile / "DevToolsActivePort").read_text(encoding="utf-8").split()[0])
            with closing(HTTPConnection("127.0.0.1", port, timeout=5.0)) as connection:
                connection.request("GET", "/json/list")
                targets = json.loads(connection.getresponse().read())
            pages = [target["webSocketDebuggerUrl"] for target in targets if target["type"] == "page"]
            if pages:
                return str(pages[0])
        time.sleep(0.05)
    raise OutputError(f"the browser did not answer within {_PATIENCE:.0f} s")
