"""Photographs the reports of case 0529 as a screen and a telephone show them: `python docs/make_reports.py [FOLDER]`.

FOLDER keeps the results, in `run`, `estimate` and `diagnose`; what lies there already is not computed again. Without
one all three are computed, which takes minutes. It needs a Chromium.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

from figure_records import record
from PIL import Image

FIGURES = Path(__file__).parent / "figures"
COMMANDS = ("run", "estimate", "diagnose")
#: Width of a window, and how much of a page is kept below each other [pixel].
WINDOWS = {1200: 2400, 400: 4200}
#: Colours that are left of a picture: a fraction of the bytes.
PALETTE = 256
#: Chromium's windows are not narrower than this; a page is as narrow as its frame.
_NARROWEST = 520


def main(folder: Path) -> None:
    """Compute what is missing, and photograph."""
    for command in COMMANDS:
        page = folder / command / "report.html"
        if not page.is_file():
            arguments = [command, "--case", "0529", "--out", str(folder / command)]
            subprocess.run([sys.executable, "-m", "warpbrain", *arguments], check=True)
        for width, height in WINDOWS.items():
            picture = FIGURES / f"report-{command}-{width}.png"
            photograph(page, picture, width, height)
            record("python docs/make_reports.py", [picture.name])


def photograph(page: Path, picture: Path, width: int, height: int) -> None:
    """Take a picture of the upper part of a page, in a window of that width."""
    with tempfile.TemporaryDirectory() as folder:
        frame = Path(folder) / "frame.html"
        frame.write_text(
            f'<!DOCTYPE html><style>body {{ margin: 0 }} iframe {{ border: 0; display: block }}</style><iframe src="'
            f'{page.resolve().as_uri()}" width="{width}" height="{height}"></iframe>',
            encoding="utf-8",
        )
        options = (
            *("--headless", "--no-sandbox", "--disable-dev-shm-usage", "--hide-scrollbars"),
            *("--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--allow-file-access-from-files"),
            *(f"--window-size={max(width, _NARROWEST)},{height}", "--virtual-time-budget=8000"),
            f"--user-data-dir={folder}/profile",
        )
        subprocess.run(["chromium", *options, f"--screenshot={picture}", frame.as_uri()], check=True)
    with Image.open(picture) as image:
        shown = image.convert("RGB").crop((0, 0, width, height))
    # a page of a telephone is long: its parts stand side by side
    if width < _NARROWEST:
        shown = _side_by_side(shown, 3)
    # the few pixels of a colour that nothing else has count as much as the many of the paper
    few = shown.quantize(PALETTE, method=Image.Quantize.MAXCOVERAGE, kmeans=3, dither=Image.Dither.NONE)
    few.save(picture, optimize=True)


def _side_by_side(image: Image.Image, count: int) -> Image.Image:
    """A tall picture cut into so many parts of the same height."""
    width, height, gap = image.width, image.height // count, 24
    found = Image.new("RGB", (width * count + gap * (count - 1), height), "#888888")
    for k in range(count):
        found.paste(image.crop((0, k * height, width, (k + 1) * height)), (k * (width + gap), 0))
    return found


if __name__ == "__main__":
    if len(sys.argv) > 1:
        main(Path(sys.argv[1]))
    else:
        with tempfile.TemporaryDirectory() as made:
            main(Path(made))
