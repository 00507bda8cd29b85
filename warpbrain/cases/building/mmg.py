"""MMG: coarsens a fine, exactly cut mesh to the wanted number of nodes or tetrahedra.

MMG answers Ctrl-C by ending the process that it runs in. Here that is a child, `python -m warpbrain.cases.building.mmg
IN OUT OPTIONS`, and the program itself clears up.
"""

import importlib.util
import json
import subprocess
import sys
import tempfile
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from warpbrain.arrays import Bools, Floats, Ints
from warpbrain.errors import InputError

#: Exit status of the child where MMG gave up.
_GAVE_UP = 3


def require_extra(modules: Collection[str] = ("mmgpy", "nilearn", "nibabel", "scipy", "meshio")) -> None:
    """Stop with a plain sentence if one of the packages that only building needs is missing."""
    if missing := [module for module in modules if importlib.util.find_spec(module) is None]:
        raise InputError(
            f"building meshes needs {', '.join(missing)}, not installed here: pip install 'warpbrain[build]'. "
            "Running the shipped cases does not need it."
        )


def run_mmg(
    points: Floats, tetrahedra: Ints, labels: Ints, options: dict[str, float]
) -> tuple[Floats, Ints, Ints] | None:
    """Remesh points (n, 3), tetrahedra (m, 4) and labels (m,) with options of `mmgpy.MmgMesh3D.remesh`; None where MMG
    gives up, `InputError` if the child cannot be run at all."""
    with tempfile.TemporaryDirectory(prefix="warpbrain-mmg-") as folder:
        given, made = Path(folder) / "given.npz", Path(folder) / "made.npz"
        np.savez(given, points=points, tetrahedra=tetrahedra, labels=labels)
        command = [sys.executable, "-m", "warpbrain.cases.building.mmg", str(given), str(made), json.dumps(options)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode == _GAVE_UP:
            return None
        if done.returncode != 0 or not made.exists():
            message = (done.stderr.strip() or done.stdout.strip() or f"exit status {done.returncode}").splitlines()[-1]
            raise InputError(f"MMG could not be run: {message}")
        with np.load(made) as result:
            return result["points"], result["tetrahedra"], result["labels"]


def _child(given: Path, made: Path, options: dict[str, float]) -> int:
    from mmgpy import MmgMesh3D

    with np.load(given) as data:
        arrays = dict(data)
    mesh = MmgMesh3D()
    mesh.set_mesh_size(vertices=len(arrays["points"]), tetrahedra=len(arrays["tetrahedra"]))
    mesh.set_vertices(arrays["points"])
    mesh.set_tetrahedra(arrays["tetrahedra"].astype(np.int32), arrays["labels"].astype(np.int64))
    try:
        mesh.remesh(**options)
    except RuntimeError:
        return _GAVE_UP
    tetrahedra, labels = mesh.get_elements_with_refs()
    np.savez(
        made,
        points=mesh.get_vertices(),
        tetrahedra=np.asarray(tetrahedra, dtype=np.int64),
        labels=np.asarray(labels, dtype=np.int64),
    )
    return 0


# of the largest edge: the smallest edge, and how far surfaces may move from where they were cut
SMALLEST_EDGE = 0.3
SURFACE_TOLERANCE = 0.25
GRADATION = 2.2
TRIALS = 40


@dataclass(frozen=True)
class Cells:
    """A mesh in the making: points (n, 3) [mm], tetrahedra (m, 4), labels (m,)."""

    points: Floats
    tetrahedra: Ints
    labels: Ints

    def part(self, chosen: Bools) -> "Cells":
        """Some of the tetrahedra (m,), and all points."""
        return Cells(self.points, self.tetrahedra[chosen], self.labels[chosen])

    def compact(self) -> "Cells":
        """The same without points that no tetrahedron uses."""
        used, inverse = np.unique(self.tetrahedra, return_inverse=True)
        return Cells(self.points[used], inverse.reshape(self.tetrahedra.shape), self.labels)


@dataclass(frozen=True)
class Size:
    """Wanted count of nodes or of tetrahedra, `at_least` to `at_most`."""

    of: str
    at_least: int
    at_most: int

    def count(self, cells: Cells) -> int:
        """What is counted, in a mesh."""
        return len(cells.points) if self.of == "nodes" else len(cells.tetrahedra)


def remesh(cells: Cells, edge: float) -> Cells | None:
    """One pass of MMG with a largest edge [mm]; None where it gives up, which it does for some sizes and not for their
    neighbours. Interfaces between labels are kept, and moved by no more than the tolerance."""
    # no ridge detection: a brain has no edges, and what looks like one is left over from the cutting
    options = {
        "hmax": edge,
        "hmin": SMALLEST_EDGE * edge,
        "hausd": SURFACE_TOLERANCE * edge,
        "hgrad": GRADATION,
        "angle": 0,
        "verbose": -1,
    }
    made = run_mmg(cells.points, cells.tetrahedra, cells.labels, options)
    return None if made is None else Cells(*made)


def fit_size(cells: Cells, size: Size, edge: float, good: Callable[[Cells], Cells | None]) -> Cells:
    """Find the edge length that gives the wanted count, and a mesh there that is good.

    `cells`: fine mesh to start every trial from.
    `edge`: first guess of the largest edge [mm].
    `good`: finishes a mesh of the right size; None if it is not good enough. The first good one met is returned; the
    search is deterministic.
    """
    goal = 0.5 * (size.at_least + size.at_most)
    seen: list[tuple[float, int]] = []
    for _ in range(TRIALS):
        made = remesh(cells, edge)
        if made is not None:
            count = size.count(made)
            seen.append((edge, count))
            if size.at_least <= count <= size.at_most:
                finished = good(made)
                if finished is not None:
                    return finished
        edge = next(e for e in _proposals(seen, goal, edge) if all(abs(e / old - 1) > 4e-4 for old, _ in seen))
    raise InputError(f"no mesh with {size.at_least} to {size.at_most} {size.of} in {TRIALS} trials; tried {seen}")


def _proposals(seen: list[tuple[float, int]], goal: float, edge: float) -> Iterator[float]:
    """Edge lengths to try next: where a power law through what was seen meets the goal, then ever farther around it."""
    guess = edge
    if seen:
        near = sorted(seen, key=lambda pair: abs(np.log(pair[1] / goal)))[:3]
        logs = np.log(np.array(near, dtype=float))
        # counts scatter by a per cent from size to size: a slope is fitted only to sizes that are well apart
        slope = 2.0
        if np.ptp(logs[:, 0]) > 0.02:
            slope = float(np.clip(-np.polyfit(logs[:, 0], logs[:, 1], 1)[0], 1.0, 3.0))
        guess = float(np.exp(logs[0, 0] + (logs[0, 1] - np.log(goal)) / slope))
    yield guess
    for step in range(1, 400):
        yield guess * (1 + 0.0013 * step)
        yield guess * (1 - 0.0013 * step)


if __name__ == "__main__":
    raise SystemExit(_child(Path(sys.argv[1]), Path(sys.argv[2]), json.loads(sys.argv[3])))
