"""Make what is observed in the stand-ins: ``python -m concealed.make all``, or the names of some.

Draws what acts, fits how strongly, seals the truth and publishes recordings and hash. It says how far the walls moved
and nothing about why. A case made alone keeps the motion that was wanted of it when all were made. With ``--again`` it
keeps all that was drawn, too: strength and level are fitted again, and recordings made, by the solver as it is now.
"""

from __future__ import annotations

import argparse
import secrets
import sys
from dataclasses import replace
from pathlib import Path

from concealed.body import Body, body_of
from concealed.draw import draw
from concealed.observing import observed_nodes, rms
from concealed.places import CASES, MESHES, truth_file
from concealed.publish import publish
from concealed.published import NAMES
from concealed.record import Truth, read_truth, write_truth
from concealed.sealing import fingerprint, open_sealed, read_sealed, sealed, write_sealed
from concealed.targets import draw_targets
from concealed.trial import CoarseTrial, Trial
from concealed.truth_mesh import truth_mesh
from concealed.tuning import Tuned, Unreachable, first_guess, tune
from warpbrain.cases.building.pipeline import RECIPES
from warpbrain.errors import SolveError
from warpbrain.mesh import read_mesh

Shipped = tuple[Body, Body]

ATTEMPTS = 60
#: Relative miss of the wanted motion that is let pass: on the coarse mesh to go on, on the fine mesh to end.
COARSE_MISS, FINE_MISS = 0.04, 0.03


def fitted(trial: Trial, coarse: CoarseTrial, wanted: tuple[float, float]) -> Tuned:
    """Strength and level at which the walls move as wanted; `Unreachable` if there are none."""
    limit = trial.drawn.main.limit
    guess = first_guess(coarse.motion, limit, wanted)
    near = tune(coarse.motion, limit, wanted, guess, close=0.02)
    if near.miss > COARSE_MISS:
        raise Unreachable
    found = tune(trial.motion, limit, wanted, near.strength, near.level, near.slopes, close=0.02, rounds=4)
    if found.miss > FINE_MISS:
        raise Unreachable
    return found


def find_truth(name: str, body: Body, shipped: Shipped, wanted: tuple[float, float]) -> tuple[Truth, Trial]:
    """Draw until the wanted motion is reached at a plausible strength.

    Parameters
    ----------
    name : str
    body : Body
        On the fine mesh.
    shipped : (Body, Body)
        On the meshes of one tissue and of two.
    wanted : (float, float)
        Motion of ventricles and cavity [m].
    """
    seed = secrets.randbits(128)
    nodes = observed_nodes(name, body, shipped)
    for attempt in range(ATTEMPTS):
        drawn = draw(seed, attempt, body)
        try:
            found = fitted(Trial(drawn, body, nodes), CoarseTrial(drawn, shipped[1]), wanted)
            # from rest, as it is made again when it is checked
            trial = Trial(drawn, body, nodes)
            trial.observed(found.strength, found.level)
        except (Unreachable, SolveError):
            continue
        truth = Truth(
            name=name,
            seed=seed,
            attempt=attempt,
            wanted=wanted,
            drawn=drawn,
            strength=found.strength,
            level=found.level,
        )
        return truth, trial
    raise RuntimeError(f"case {name}: nothing that was drawn in {ATTEMPTS} attempts moves the walls as wanted")


def find_truth_again(name: str, body: Body, shipped: Shipped) -> tuple[Truth, Trial]:
    """The sealed truth of a case with strength and level fitted again to the motion that was wanted of it.

    Raises
    ------
    Unreachable
        If that motion is not reached any more.
    """
    truth = read_truth(open_sealed(read_sealed(truth_file(name))))
    nodes = observed_nodes(name, body, shipped)
    limit = truth.drawn.main.limit
    trial = Trial(truth.drawn, body, nodes)
    found = tune(trial.motion, limit, truth.wanted, truth.strength, truth.level, close=0.01)
    if found.miss > FINE_MISS:
        raise Unreachable
    # from rest, as it is made again when it is checked
    return replace(truth, strength=found.strength, level=found.level), Trial(truth.drawn, body, nodes)


def make(name: str, wanted: tuple[float, float] | None, meshes: Path) -> tuple[float, float]:
    """Make, seal and publish one case; returns the motion of ventricles and cavity [m].

    Parameters
    ----------
    name : str
    wanted : (float, float) or None
        Motion of ventricles and cavity [m]; None: what was drawn and wanted of it before.
    meshes : Path
        Folder of fine meshes.
    """
    side = str(RECIPES[name].resection)
    mesh = truth_mesh(name, meshes)
    single, multi = (read_mesh(CASES / name / f"{tissue}.vtu", unit="mm") for tissue in ("single", "multi"))
    shipped = body_of(single, side), body_of(multi, side)
    body = body_of(mesh, side)
    if wanted is None:
        truth, trial = find_truth_again(name, body, shipped)
    else:
        truth, trial = find_truth(name, body, shipped, wanted)
    seen = trial.observed(truth.strength, truth.level)
    data = sealed(write_truth(truth, trial, mesh))
    walls = [(trial.body.mesh.points[nodes], u) for nodes, u in zip(trial.nodes, seen, strict=True)]
    write_sealed(truth_file(name), data)
    publish(CASES / name, truth.declared_level, walls, fingerprint(data))
    return rms(seen[0]), rms(seen[1])


def _wanted(names: list[str]) -> dict[str, tuple[float, float]]:
    if set(names) == set(NAMES):
        return draw_targets(secrets.randbits(128))
    motions = {}
    for name in names:
        ventricles, cavity = open_sealed(read_sealed(truth_file(name)))["wanted_rms_m"]
        motions[name] = (ventricles, cavity)
    return motions


def main(arguments: list[str] | None = None) -> int:
    """Entry point."""
    parser = argparse.ArgumentParser(prog="python -m concealed.make", description=__doc__)
    parser.add_argument("names", nargs="+", choices=[*NAMES, "all"], metavar="NAME")
    parser.add_argument("--meshes", type=Path, default=MESHES, help="folder of fine meshes, outside the repository")
    parser.add_argument("--again", action="store_true", help="keep what was drawn; fit strengths and levels again")
    given = parser.parse_args(arguments)
    names = list(NAMES) if "all" in given.names else list(dict.fromkeys(given.names))
    for name, wanted in (dict.fromkeys(names) if given.again else _wanted(names)).items():
        ventricles, cavity = make(name, wanted, given.meshes)
        print(f"{name}: sealed; ventricles moved {1e3 * ventricles:.2f} mm, cavity {1e3 * cavity:.2f} mm", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
