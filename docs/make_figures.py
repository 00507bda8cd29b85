"""Makes the figures of README and docs: `python docs/make_figures.py`."""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from figure_records import record
from PIL import Image

from warpbrain.gp.trained import trained
from warpbrain.report.generative_pictures import draw_draws, draw_extrapolation, draw_studies, save

FIGURES = Path(__file__).parent / "figures"
COMMAND = "python docs/make_figures.py"
#: Pictures of runs, of ensembles and of cases, by file.
RUNS = {"0614.png": ["--case", "0614"]}
ENSEMBLES = {"0529-spread.png": ["--case", "0529", "--tissue", "single", "--grid"]}
CASES = {"0529-case.png": ["0529"]}
#: Colours that are left of a picture of curves, and its width [pixel]: a screen's, and a fraction of the bytes.
PALETTE, WIDTH = 48, 1280
#: Width of a picture of a body [pixel], which has shades and is kept in more colours.
RENDERED = 1200
#: Figures of an estimate and of a sweep of the same case, by file.
ESTIMATES = {"estimate-0529-sweep.png": "sweep.png", "estimate-0529-residuals.png": "residuals.png"}


def main() -> None:
    """Run, estimate or show each case and keep its pictures; the sweep alone takes minutes."""
    FIGURES.mkdir(exist_ok=True)
    for name, arguments in RUNS.items():
        with tempfile.TemporaryDirectory() as folder:
            _warpbrain("run", *arguments, "--out", folder)
            few_colours(Path(folder) / "deformation.png", FIGURES / name)
    for name, arguments in ENSEMBLES.items():
        with tempfile.TemporaryDirectory() as folder:
            _warpbrain("ensemble", *arguments, "--out", folder)
            shutil.copy(Path(folder) / "spread.png", FIGURES / name)
    with tempfile.TemporaryDirectory() as folder:
        for method in ("posterior", "grid"):
            _warpbrain("estimate", "--case", "0529", "--method", method, "--out", folder)
        for name, made in ESTIMATES.items():
            shutil.copy(Path(folder) / made, FIGURES / name)
    for name, arguments in CASES.items():
        _warpbrain("cases", "show", *arguments, "--out", str(FIGURES / name), "--overwrite")
    record(COMMAND, [*RUNS, *ENSEMBLES, *ESTIMATES, *CASES])
    draw_generative_model()


def few_colours(picture: Path, kept: Path) -> None:
    """Keep a picture of a body in the width of a page and in 256 colours."""
    with Image.open(picture) as image:
        size = (RENDERED, round(image.height * RENDERED / image.width))
        small = image.convert("RGB").resize(size, Image.LANCZOS)
    few = small.quantize(256, method=Image.Quantize.MAXCOVERAGE, kmeans=3, dither=Image.Dither.NONE)
    few.save(kept, optimize=True)


def draw_generative_model() -> None:
    """Draw the default model, with the paper's process beside it and by itself."""
    model, paper = trained(), trained("coregionalised", "as_published")
    brain = "hyperelastic/brain"
    pictures = {
        "gp-studies.png": draw_studies(model),
        "gp-extrapolation.png": draw_extrapolation(model, paper),
        "gp-draws.png": draw_draws(model),
        "gp-draws-paper.png": draw_draws(paper),
        "gp-draws-brain.png": draw_draws(model, brain),
    }
    for name, figure in pictures.items():
        save(figure, FIGURES / name)
        with Image.open(FIGURES / name) as image:
            small = image.convert("RGB").resize((WIDTH, round(image.height * WIDTH / image.width)), Image.LANCZOS)
        small.quantize(PALETTE, dither=Image.Dither.NONE).save(FIGURES / name, optimize=True)
    record(COMMAND, pictures)


def _warpbrain(*arguments: str) -> None:
    subprocess.run([sys.executable, "-m", "warpbrain", *arguments], check=True)


if __name__ == "__main__":
    main()
