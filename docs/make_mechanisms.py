"""Makes the pages and pictures of the mechanisms from their files: `python docs/make_mechanisms.py [KIND ...]`.

A picture is made again where its mechanism's file, its example or the phantom has changed since; a KIND is in any case.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from figure_records import record
from matplotlib import colormaps
from matplotlib.colors import to_rgb
from mechanism_pages import (
    Effect,
    digest_of,
    index,
    made_from,
    page,
    pairs_page,
    pairs_table,
    read_costs,
    read_effects,
    table,
    write_effects,
)
from mechanism_picture import INKS, write_picture
from numpy.typing import NDArray
from PIL import Image

from warpbrain.bench.mechanisms import BASE
from warpbrain.cases.assuming import assume
from warpbrain.cases.case import Case
from warpbrain.cases.shipped import find_case
from warpbrain.mesh import TetMesh
from warpbrain.physics.mechanisms import mechanisms
from warpbrain.simulation.dynamics import Simulator
from warpbrain.simulation.equilibrium import EquilibriumSolver
from warpbrain.simulation.of_case import model_of
from warpbrain.simulation.system import System
from warpbrain.terminal.progress import Progress
from warpbrain.terminal.quiet import start_warp_quietly

DOCS = Path(__file__).parent
PAGES, FIGURES, RESULTS = DOCS / "mechanisms", DOCS / "figures", DOCS.parent / "bench" / "results"
EFFECTS = PAGES / "effects.json"
#: A mechanism that adds less than this in equilibrium [m] is shown in motion, after so many steps of 1 ms.
NOTHING, STEPS = 1e-6, 50


def main() -> None:
    """Make pictures that are not of the present files, and all pages."""
    start_warp_quietly()
    PAGES.mkdir(exist_ok=True)
    effects = read_effects(EFFECTS)
    case, progress = find_case(BASE), Progress("pictures")
    for number, kind in enumerate(mechanisms()):
        known = effects.get(kind)
        if known is None or kind in sys.argv[1:] or known != _as_it_is(kind, known):
            progress.show(number / len(mechanisms()), kind)
            effects[kind] = draw(case, kind)
            write_effects(EFFECTS, effects)
            progress.clear()
            print(f"{kind}: {effects[kind].largest:.2f} mm", flush=True)
    costs = read_costs(sorted(RESULTS.glob("mechanisms_*.json")))
    for kind in mechanisms():
        _write(PAGES / f"{kind}.md", page(kind, effects[kind]))
    _write(PAGES / "index.md", index(effects, costs))
    _write(PAGES / "cost.csv", "\n".join([*table(costs, list(mechanisms())), ""]))
    _write(PAGES / "pairs.md", pairs_page())
    _write(PAGES / "pairs.csv", pairs_table())


def draw(case: Case, kind: str) -> Effect:
    """Simulate the phantom with and without a mechanism and draw what it adds."""
    assumed = assume(case, mechanisms()[kind].example)
    for steps in (0, STEPS):
        (_, plain, _), (mesh, u, nodes) = _deformed(case, steps), _deformed(assumed, steps)
        difference = u - plain[nodes]
        sizes = np.linalg.norm(difference, axis=1)
        if sizes.max() > NOTHING:
            break
    file = _figure(kind)
    write_picture(file, case, mesh, difference, kind)
    _shrink(file)
    record("python docs/make_mechanisms.py", [file.name])
    worst = int(sizes.argmax())
    x = tuple(round(1000.0 * float(x), 1) for x in mesh.points[worst])
    largest = round(1000.0 * float(sizes[worst]), 3)
    return Effect(largest, (x[0], x[1], x[2]), steps, made_from(kind), digest_of(file))


def _deformed(case: Case, steps: int) -> tuple[TetMesh, NDArray[np.float64], NDArray[np.int32]]:
    """Mesh, displacement [m] in equilibrium or after some steps, and ids of its nodes in the case's mesh."""
    model, nodes = model_of(case), case.remaining[1]
    if not steps:
        return model.mesh, EquilibriumSolver(System(model, "cpu")).solve().u, nodes
    simulator = Simulator(System(model, "cpu"))
    for _ in range(steps):
        simulator.step()
        simulator.check()
    return model.mesh, simulator.system.u.numpy().copy(), nodes


def _shrink(path: Path) -> None:
    """Leave 256 colours of a picture, all that it was made of: a third of the bytes, and no difference to an eye."""
    white = np.ones(3)
    tints = [t * np.array(to_rgb(ink)) + (1.0 - t) * white for ink in INKS for t in (1.0, 0.75, 0.5, 0.25)]
    greys = [t * white for t in np.linspace(0.0, 1.0, 40)]
    scale = colormaps["viridis"](np.linspace(0.0, 1.0, 256 - len(tints) - len(greys)))[:, :3]
    palette = Image.new("P", (1, 1))
    palette.putpalette(np.round(255.0 * np.array([*tints, *greys, *scale])).astype(np.uint8).ravel().tolist())
    with Image.open(path) as image:
        small = image.convert("RGB").quantize(palette=palette, dither=Image.Dither.NONE)
    small.save(path, optimize=True)


def _as_it_is(kind: str, known: Effect) -> Effect:
    return replace(known, made_from=made_from(kind), picture=digest_of(_figure(kind)))


def _figure(kind: str) -> Path:
    return FIGURES / f"mechanism-{kind}.png"


def _write(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
