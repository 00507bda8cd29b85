"""Simulation-based calibration (Talts and others 2018, arXiv:1804.06788): truths drawn from the prior of an estimate,
recordings of them drawn from its noise, and where in its posterior each truth lies.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rigid_motions import moved as moved_rigidly
from scipy.spatial.transform import Rotation
from scipy.special import ndtr
from shapes import box

from warpbrain.cases.boundary import Fixed
from warpbrain.cases.case import Case, Tissue
from warpbrain.errors import SolveError
from warpbrain.estimation.estimate import estimate
from warpbrain.estimation.finer_mesh import Discretisation
from warpbrain.estimation.forward import Forward, State
from warpbrain.estimation.options import EstimationOptions
from warpbrain.estimation.posterior import Posterior
from warpbrain.gp.prior import Prior
from warpbrain.inference.noise import noise_covariance, noise_factor, outliers, scales
from warpbrain.mesh import TetMesh, nodes_of
from warpbrain.mesh.refinement import refined
from warpbrain.physics.mechanisms.gravity import Gravity
from warpbrain.recordings.base import Registration
from warpbrain.recordings.location import locate
from warpbrain.recordings.recording import PointsRecording

Floats = NDArray[np.float64]

SIDE = 0.03
#: A level that cuts elements, none of whose faces lies in it.
DOWN = (0.3, 0.2, -1.0)


@dataclass(frozen=True)
class Setting:
    """What is estimated from what.

    Attributes
    ----------
    shape : {"block", "round"}
        A block of distorted elements in layers of tissue, or a rounded body with the second tissue in its core.
    tissues : int
    level : float or None
        Of the fluid, relative to the body's height; None: there never was any, and a weight of 300 kg/m3 acts.
    noise : float
        Root mean square length of the noise, relative to that of the motion in the middle of the prior.
    other_elements : bool
        Truths are of quadratic elements of half the size, and the estimate knows that its mesh is wrong. Tissue is more
        compressible then: near nu = 1/2 a mesh as small as this is too coarse, as an estimate of it says.
    registration : bool
        Recordings are shifted and turned, and the estimate knows that they may be.
    """

    shape: str
    tissues: int
    level: float | None
    noise: float
    other_elements: bool = False
    registration: bool = False

    @property
    def name(self) -> str:
        """For the names of tests."""
        parts = [self.shape, f"{self.tissues}", "dry" if self.level is None else f"level {self.level:g}"]
        parts += [f"noise {self.noise:g}"] + ["other elements"] * self.other_elements
        return ", ".join(parts + ["registration"] * self.registration)


def body(setting: Setting) -> Case:
    """The case without recordings; its laws are those that an estimate does not know."""
    cells = 4 if setting.shape == "round" or setting.other_elements else 3
    corner = box((cells,) * 3, (2.0,) * 3)
    x = corner.points - 1.0
    if setting.shape == "round":
        largest, length = np.abs(x).max(axis=1), np.linalg.norm(x, axis=1)
        x = x * (0.5 + 0.5 * largest / np.where(length > 0.0, length, 1.0))[:, None] * [1.0, 0.9, 0.8]
    else:
        inside = np.abs(x) < 1.0 - 1e-9
        x = x + 0.12 / cells * np.random.default_rng(0).uniform(-1.0, 1.0, x.shape) * inside
    points = 0.5 * SIDE * (x - x.min(axis=0))
    middle = x[corner.tetrahedra].mean(axis=1)
    second = np.linalg.norm(middle, axis=1) < 0.6 if setting.shape == "round" else middle[:, 2] < 0.0
    tissue = np.where(second & (setting.tissues == 2), 2, 1)
    low = nodes_of(corner.boundary, len(x)) & (x[:, 2] < x[:, 2].min() + (0.5 if setting.shape == "round" else 1e-9))
    mesh = TetMesh(points, corner.tetrahedra, tissue, node_sets={"table": low})
    groups = (
        ["hyperelastic/brain"] if setting.tissues == 1 else ["hyperelastic/grey matter", "hyperelastic/white matter"]
    )
    tissues = {label: Tissue(group, None, "coupled", group, "neo-hookean") for label, group in enumerate(groups, 1)}
    height = np.ptp(points @ np.array(DOWN)) / np.linalg.norm(DOWN)
    if setting.level is None:
        weight = Gravity(direction=DOWN, density=300.0)
    else:
        weight = Gravity(direction=DOWN, density=1040.0, csf_level=setting.level * height)
    poisson = 0.3 if setting.other_elements else 0.45
    return Case(
        setting.shape, setting.name, "synthetic", Path("case.toml"), mesh, tissues, 1040.0, poisson,
        boundaries=(Fixed(name="table", nodes="table"),), mechanisms=(weight,),
    )  # fmt: skip


@cache
def prior(tissues: int) -> Prior:
    """What an estimate of so many tissues takes unless told."""
    from warpbrain.gp.trained import trained

    groups = ["hyperelastic/brain"] if tissues == 1 else ["hyperelastic/grey matter", "hyperelastic/white matter"]
    return Prior.of(trained(), groups, "neo-hookean", count=500)


class Truths:
    """States of draws of the prior that are not those which it rests on."""

    def __init__(self, setting: Setting, case: Case, seed: int, count: int) -> None:
        fine = replace(case, mesh=refined(case.mesh)[0]) if setting.other_elements else case
        self._middle = prior(setting.tissues).mean
        self._forward = Forward(fine, self._middle, "cpu", elements="tet10" if setting.other_elements else "tet4")
        self.middle = self._forward.solve(self._middle)
        self.mesh = self._forward.states[-1].system.model.node_mesh
        self._drawn = iter(prior(setting.tissues).samples(count, 10_000 + seed))

    def next(self) -> State:
        """Of the next draw that has an equilibrium: there is none to record of one that has none."""
        for theta in self._drawn:
            # a weight moves the more, the softer it is
            start = np.exp(np.mean(self._middle - theta)) * self.middle.u
            for beginning in (start, None):
                try:
                    return self._forward.solve(theta, beginning)
                except SolveError:
                    continue
        raise AssertionError("all draws are used up")


def ranks(setting: Setting, count: int, seed: int = 0) -> Floats:
    """Posterior probabilities (count, p) that parameters are less than the truth: uniform, if all is as it is said.

    Where there is no estimate at all, 0: a truth outside of every interval.
    """
    case = body(setting)
    # some draws have no equilibrium
    truths = Truths(setting, case, seed, 2 * count + 20)
    motion = float(np.sqrt(np.mean(np.sum(truths.middle.u**2, axis=1))))
    sigma = setting.noise * motion / np.sqrt(3.0)
    registration = Registration(motion, 0.05) if setting.registration else None
    found = np.zeros((count, setting.tissues))
    for number in range(count):
        rng = np.random.default_rng([seed, number])
        truth = truths.next()
        recording = record(case.mesh, truths, truth, sigma, registration, rng)
        options = EstimationOptions(
            discretisation=Discretisation() if setting.other_elements else None,
            registration=setting.registration,
            samples=25,
            seed=number,
        )
        seen = replace(case, recordings=(recording,), registration=registration)
        try:
            posterior = estimate(seen, prior(setting.tissues), options, "cpu")
        except SolveError:
            continue
        found[number] = probability_below(posterior, truth.theta)
    return found


def probability_below(posterior: Posterior, theta: Floats) -> Floats:
    """Of each parameter (p,) that it is less than that of a vector (p,)."""
    if posterior.chain is None:
        return np.asarray(ndtr((theta - posterior.theta) / posterior.best.laplace.posterior.standard_deviations))
    return np.asarray(np.mean(posterior.chain.theta < theta, axis=0))


def noise_of(points: Floats, sigma: float, radius: float, rng: np.random.Generator) -> Floats:
    """Noise (n, 3) as it is believed to be where `sigma` is declared: its size, what neighbours share, gross errors."""
    count, (values, log_probability) = len(points), scales()
    along, times = np.tile(np.eye(3), (count, 1)), np.full(3 * count, np.inf)
    sigmas = np.full(3 * count, sigma)
    factor = noise_factor(noise_covariance(np.repeat(points, 3, axis=0), along, times, sigmas, radius), sigmas)
    believed = outliers()
    inflation = rng.choice(believed.inflations, count, p=np.exp(believed.log_probabilities))
    found = factor @ rng.normal(size=3 * count)
    blocks = np.array([(factor @ factor.T)[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] for k in range(count)])
    more = np.einsum("nij,nj->ni", np.linalg.cholesky(blocks), rng.normal(size=(count, 3)))
    found = found.reshape(count, 3) + np.sqrt(inflation**2 - 1.0)[:, None] * more
    return np.asarray(rng.choice(values, p=np.exp(log_probability)) * found)


def record(
    mesh: TetMesh,
    truths: Truths,
    truth: State,
    sigma: float,
    registration: Registration | None,
    rng: np.random.Generator,
    count: int = 40,
) -> PointsRecording:
    """Points spread evenly over the body, recorded with the noise that is believed of a declared standard deviation."""
    chosen = mesh.tetrahedra[rng.choice(len(mesh.tetrahedra), count, p=mesh.volumes / mesh.volumes.sum())]
    points = np.einsum("ni,nij->nj", rng.dirichlet(np.ones(4), count), mesh.points[chosen])
    moved = locate(truths.mesh.points, truths.mesh.tetrahedra, points).interpolate(truth.u)
    moved = moved + noise_of(points, sigma, mesh.radius, rng)
    if registration is not None:
        shift, turn = registration.shift * rng.normal(size=3), registration.turn * rng.normal(size=3)
        # about the mean of what is recorded then
        positions = points + moved
        centre = positions.mean(axis=0) + Rotation.from_rotvec(turn).inv().apply(shift)
        moved = moved_rigidly(positions, np.concatenate([shift, turn]), centre) - points
    return PointsRecording(name="beads", file="", points=points, displacement=moved, sigma=sigma)
