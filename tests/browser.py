"""A headless Chromium that opens a page, answers questions about it and takes pictures."""

import asyncio
import base64
import itertools
import json
import shutil
import subprocess
import tempfile
import time
import urllib.request
from pathlib import Path

CHROMIUM = (
    shutil.which("chromium") or shutil.which("google-chrome") or shutil.which("chromium-browser")
)
OPTIONS = (
    "--headless", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
    "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--remote-debugging-port=0",
)  # fmt: skip


class Browser:
    """One page of one size; `faults` are the errors that its console showed."""

    def __init__(self, file, width=1400, height=900):
        self.file, self.size, self.faults = Path(file), (width, height), []

    def __enter__(self):
        from tornado.websocket import websocket_connect

        self.folder = tempfile.mkdtemp()
        command = [CHROMIUM, *OPTIONS, f"--user-data-dir={self.folder}", "about:blank"]
        self.process = subprocess.Popen(
            command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        port = Path(self.folder, "DevToolsActivePort")
        end = time.time() + 60
        while not (port.exists() and port.read_text().strip()):
            assert time.time() < end and self.process.poll() is None, "the browser did not start"
            time.sleep(0.1)
        number = port.read_text().split()[0]
        with urllib.request.urlopen(f"http://127.0.0.1:{number}/json") as answer:
            address = next(
                tab["webSocketDebuggerUrl"] for tab in json.load(answer) if tab["type"] == "page"
            )
        self.loop, self.numbers = asyncio.new_event_loop(), itertools.count(1)

        async def connect():
            return await websocket_connect(address, max_message_size=2**28)

        self.socket = self.loop.run_until_complete(connect())
        for domain in ("Runtime", "Log", "Page"):
            self.call(f"{domain}.enable")
        width, height = self.size
        self.call(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=height,
            deviceScaleFactor=1,
            mobile=False,
        )
        self.call("Page.navigate", url=self.file.resolve().as_uri())
        return self

    def __exit__(self, *error):
        self.socket.close()
        self.process.terminate()
        self.process.wait()
        self.loop.close()
        shutil.rmtree(self.folder, ignore_errors=True)

    def call(self, method, **arguments):
        return self.loop.run_until_complete(asyncio.wait_for(self._call(method, arguments), 120))

    async def _call(self, method, arguments):
        number = next(self.numbers)
        await self.socket.write_message(
            json.dumps({"id": number, "method": method, "params": arguments})
        )
        while True:
            message = json.loads(await self.socket.read_message())
            if message.get("method") == "Runtime.exceptionThrown":
                details = message["params"]["exceptionDetails"]
                thrown = details.get("exception", {}).get("description")
                self.faults.append(thrown or details["text"])
            if message.get("method") in ("Log.entryAdded", "Runtime.consoleAPICalled"):
                entry = message["params"].get(
                    "entry",
                    {"level": message["params"].get("type"), "text": message["params"].get("args")},
                )
                if entry["level"] == "error":
                    self.faults.append(str(entry["text"]))
            if message.get("id") == number:
                assert "error" not in message, message
                return message["result"]

    def ask(self, expression):
        """The value of a JavaScript expression."""
        result = self.call(
            "Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True
        )
        assert "exceptionDetails" not in result, result["exceptionDetails"]
        return result["result"].get("value")

    def wait(self, expression, seconds=60):
        """Until the expression is true."""
        end = time.time() + seconds
        while not self.ask(expression):
            assert time.time() < end, f"still not: {expression}; {self.faults}"
            time.sleep(0.2)

    def press(self, key):
        for kind in ("keyDown", "keyUp"):
            self.call(
                "Input.dispatchKeyEvent",
                type=kind,
                key=key,
                text=key if len(key) == 1 and kind == "keyDown" else "",
            )

    def picture(self, file, whole=True):
        """A PNG of the window, or of the whole page."""
        data = self.call("Page.captureScreenshot", captureBeyondViewport=whole, format="png")[
            "data"
        ]
        Path(file).write_bytes(base64.b64decode(data))
