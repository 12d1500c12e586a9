"""Pictures of the real viewer without a screen, as arrays; skips with a reason where it cannot draw."""

from __future__ import annotations

import io
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

HEADLESS_HINT = "no headless viewer: {}; Debian's mesa-vulkan-drivers and rerun-sdk give one"


class Screen:
    """A headless viewer, 1920 x 1080."""

    def __init__(self, client: Any) -> None:
        self._client = client

    def at(self, seconds: float) -> np.ndarray:
        """The picture (h, w, 3) uint8 with the time cursor there, when it no longer changes."""
        self._client.set_time("time", duration=seconds, play_state="paused")
        return self.settled()

    def settled(self) -> np.ndarray:
        """The picture, when two in a row are alike and something is drawn."""
        before = self._shot()
        for _ in range(40):
            time.sleep(0.3)
            now = self._shot()
            if np.array_equal(before, now):
                return now
            before = now
        return before

    def soon(self) -> np.ndarray:
        """The picture in a while, for a view that never stands still."""
        time.sleep(2.0)
        return self._shot()

    def _shot(self) -> np.ndarray:
        from matplotlib.image import imread

        pixels = imread(io.BytesIO(self._client.take_screenshot()), format="png")
        return (pixels[..., :3] * 255).round().astype(np.uint8)

    def save(self, path: Path) -> None:
        """Write the present picture as a PNG."""
        path.write_bytes(self._client.take_screenshot())


@contextmanager
def screen(recording: Path | None = None, port: int | None = None) -> Iterator[Screen]:
    """A headless viewer with a recording, or empty and listening on `port`."""
    experimental = pytest.importorskip("rerun.experimental", reason="rerun-sdk is not installed")
    if not hasattr(experimental, "ViewerClient"):
        pytest.skip("this rerun-sdk has no ViewerClient")
    from fatigue_runner.viewer import window

    port = port or window.free_port()
    with window.viewer("--headless", "--port", str(port)) as process:
        client = _connect(experimental, process, port)
        if recording is not None:
            client.open(str(recording))
            _until_shown(client)
        yield Screen(client)


def _connect(experimental: Any, process: Any, port: int) -> Any:
    deadline = time.monotonic() + 30
    trouble: object = "it does not answer"
    while time.monotonic() < deadline:
        if process.poll() is not None:
            pytest.skip(HEADLESS_HINT.format(f"it ended with code {process.returncode}"))
        try:
            client = experimental.ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy")
            client.get_state()
            client.take_screenshot()  # one without a graphics library answers, and ends when it shall draw
            return client
        except Exception as error:  # the client is experimental: any error means "not yet"
            trouble = error
            time.sleep(0.2)
    pytest.skip(HEADLESS_HINT.format(trouble))


def _until_shown(client: Any) -> None:
    for _ in range(100):
        if client.get_state().views:
            return
        time.sleep(0.2)
    pytest.fail("the viewer shows no view of the recording")


def part(picture: np.ndarray, left: float, right: float, top: float = 0.0, bottom: float = 1.0) -> np.ndarray:
    """A part of a picture, in fractions of its width and height."""
    h, w = picture.shape[:2]
    return picture[int(top * h) : int(bottom * h), int(left * w) : int(right * w)]


def near(picture: np.ndarray, colour: tuple[int, int, int], distance: int = 40) -> np.ndarray:
    """Which pixels have about this colour."""
    return np.abs(picture.astype(int) - colour).max(axis=-1) <= distance


def warm(picture: np.ndarray) -> np.ndarray:
    """Which pixels are violet to yellow, as blades under load and nothing else in the scene is."""
    r, g, b = (picture[..., i].astype(int) for i in range(3))
    return (r > 70) & ((r - np.minimum(g, b)) > 45) & (r > g) & (r + 70 > b)
