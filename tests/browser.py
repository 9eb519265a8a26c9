"""A real browser without a window: what a page shows, as pixels or as its document.

No network and no display are needed: every host name fails to resolve, and WebGL is computed by
the processor.
"""

import os
import shutil
import signal
import subprocess
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")

OPTIONS = """
--headless --no-sandbox --disable-gpu --enable-unsafe-swiftshader --disable-quic --no-first-run
--disable-background-networking --disable-component-update --disable-sync --disable-extensions
--hide-scrollbars
"""
NO_NETWORK = "--host-resolver-rules=MAP * ~NOTFOUND"
TIMEOUT = 300.0  # seconds; a page takes 3 to 10, on a busy machine ten times as long


def chromium() -> str:
    """The browser; a test that needs one is skipped where there is none."""
    asked = os.environ.get("ROBOTMODELS_BROWSER")
    if asked:
        found = shutil.which(asked)
        assert found, f"ROBOTMODELS_BROWSER={asked!r} is no program"
        return found
    found = next((path for name in NAMES if (path := shutil.which(name))), None)
    if found is None:
        pytest.skip(
            f"no Chromium: none of {', '.join(NAMES)} is installed; ROBOTMODELS_BROWSER names one"
        )
    return found


def document(page: Path, folder: Path, milliseconds: int = 1500) -> str:
    """The page's document after its scripts have run for so long, as HTML."""
    return _run(page.as_uri(), folder, milliseconds, "--dump-dom")


def picture(page: Path, folder: Path, size: tuple[int, int], milliseconds: int = 1500):
    """What the page looks like: red, green and blue in [0, 1], shape (height, width, 3)."""
    shot = folder / f"{page.stem}.png"
    shot.unlink(missing_ok=True)
    _run(
        page.as_uri(), folder, milliseconds,
        f"--screenshot={shot}", f"--window-size={size[0]},{size[1]}",
    )  # fmt: skip
    assert shot.is_file(), "the browser made no picture"
    with Image.open(shot) as image:
        return np.asarray(image.convert("RGB"), dtype=np.float64) / 255.0


def _run(url: str, folder: Path, milliseconds: int, *options: str) -> str:
    words = [
        chromium(), *OPTIONS.split(), NO_NETWORK, f"--user-data-dir={folder / 'profile'}",
        f"--virtual-time-budget={milliseconds}", *options, url,
    ]  # fmt: skip
    # a session of its own, so that its helper processes end with it
    process = subprocess.Popen(
        words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    try:
        out, err = process.communicate(timeout=TIMEOUT)
    except subprocess.TimeoutExpired:
        pytest.fail(f"the browser has not finished {url} within {TIMEOUT:g} s")
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
            process.communicate()
    assert process.returncode == 0, err[-2000:]
    return out


def frames_page(path: Path, frames: list[str], width: int, height: int, script: str = "") -> Path:
    """A page of frames as notebooks have them (`Scene._repr_html_`), beside each other."""
    cells = "\n".join(
        f'<div style="position: absolute; left: {k % COLUMNS * width}px; '
        f'top: {k // COLUMNS * height}px; width: {width}px">{frame}</div>'
        for k, frame in enumerate(frames)
    )
    path.write_text(
        f'<!DOCTYPE html><html><body style="margin: 0">{cells}<pre id="results"></pre>\n'
        f"<script>window.addEventListener('load', function () {{ {script} }});</script>"
        "</body></html>",
        encoding="utf-8",
    )
    return path


COLUMNS = 4


def cells(image, count: int, width: int, height: int):
    """The frames of such a page."""
    places = [(k // COLUMNS * height, k % COLUMNS * width) for k in range(count)]
    return [image[y : y + height, x : x + width] for y, x in places]


def drawn(cell, colors=None):
    """Pixels of solid things: neither sky nor floor nor anything thinner than three pixels.

    With colors only pixels whose colour is a shade of one of them.
    """
    solid = (cell.max(axis=-1) < 0.80) | (np.ptp(cell, axis=-1) > 0.3)
    if colors is not None:
        c = np.asarray(colors)[:, :3]
        shade = np.einsum("yxi,ci->yxc", cell, c) / (c * c).sum(axis=-1)
        off = np.linalg.norm(cell[:, :, None] - shade[..., None] * c, axis=-1)
        solid &= ((off < 0.06) & (shade > 0.25) & (shade < 1.1)).any(axis=-1)
    inner = np.ones_like(solid[1:-1, 1:-1])
    for dy in range(3):
        for dx in range(3):
            inner &= solid[dy : dy + inner.shape[0], dx : dx + inner.shape[1]]
    return inner


def arm_problem(cell, colors=None, least=0.01, still=True) -> str:
    """Why a picture does not show an arm; empty if it does.

    An arm covers at least so much of the picture, is whole, and reaches into all four halves if it
    stands still: a picture has room for the whole motion, and an instant of it may be on one side.
    """
    mask = drawn(cell, colors)
    share = float(mask.mean())
    if share < least:
        return f"only {share:.2%} of the picture is drawn"
    if share > 0.6:
        return f"{share:.0%} of the picture is drawn: too near"
    h, w = mask.shape
    my, mx = max(3, h // 50), max(3, w // 50)
    rim = mask.sum() - mask[my:-my, mx:-mx].sum()
    if rim > 0.005 * mask.sum():
        return f"{rim / mask.sum():.1%} of what is drawn touches the border: it is cut off"
    y, x = np.nonzero(mask)
    for name, part in (("left", x < w / 2), ("right", x >= w / 2),
                       ("upper", y < h / 2), ("lower", y >= h / 2)):  # fmt: skip
        if still and part.mean() < 0.03:
            return f"nothing is drawn in the {name} half"
    return ""


@cache
def link_colors():
    """Colours of a skeleton: joints, links, slides and foot."""
    return ((0.95, 0.55, 0.15), (0.62, 0.66, 0.72), (0.25, 0.50, 0.80), (0.30, 0.32, 0.36))
