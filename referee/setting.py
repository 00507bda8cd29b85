"""Everything of a case but its effects: tissue, known load, how it is observed; drawn at random."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from concealed.observing import SIGMA, Blur
from referee.body import Body
from referee.geometry import declared_case, true_body
from referee.law import Demiray, Law, Ogden
from referee.problem import Load, Problem
from warpbrain.mesh import TetMesh

Floats = NDArray[np.float64]
Random = np.random.Generator

#: Where every case says that down is: the patient lies on the back.
DOWN = (0.0, -1.0, 0.0)
#: Noise that neighbours share, in parts of the noise of each alone, and over which distance [m].
SHARED, SHARED_LENGTH = 0.4, 0.025
#: Logarithm of stiffness: standard deviation of all tissue together, and of each tissue.
OVERALL, EACH = 0.25, 0.12
#: Least and largest standard deviation of its field, and lengths [m] of two kinds of it.
FIELD, LENGTHS = (0.08, 0.16), ((0.012, 0.018), (0.045, 0.07))
#: Least and largest Poisson ratio and scale of the noise; root mean square error of registration [m] and [rad].
POISSON, NOISE = (0.46, 0.48), (0.8, 1.25)
SHIFT, TURN = 0.7e-3, float(np.deg2rad(0.7))
#: Demiray's exponent; share of the first of two terms of Ogden's law, and both exponents.
DEMIRAY, OGDEN = (0.3, 2.0), ((0.4, 0.7), (2.0, 5.0), (-3.0, -1.0))


#: Random Fourier features of a field (Rahimi and Recht 2007).
_FEATURES = 600


def mean_square(ends: tuple[float, float]) -> float:
    """Of what is even between ends."""
    low, high = ends
    return (low**2 + low * high + high**2) / 3.0


def _middling(ends: tuple[float, float]) -> tuple[float, float]:
    """Two values with the mean and the variance of what is even between ends."""
    middle, sd = 0.5 * (ends[0] + ends[1]), (ends[1] - ends[0]) / np.sqrt(12.0)
    return middle - sd, middle + sd


def _laws() -> tuple[tuple[Law, float], ...]:
    # of Ogden's eight corners every other one has the same means and covariance of its three numbers
    half = [(i, j, (i + j) % 2) for i in (0, 1) for j in (0, 1)]
    corners = [tuple(_middling(ends)[k] for ends, k in zip(OGDEN, choice, strict=True)) for choice in half]
    ogden: list[Law] = [Ogden((w, 1.0 - w), (a, b)) for w, a, b in corners]
    demiray: list[Law] = [Demiray(b) for b in _middling(DEMIRAY)]
    return tuple((law, 0.5 / len(kind)) for kind in (demiray, ogden) for law in kind)


#: Laws that stand for all which are drawn, with the share of each.
BOTH_LAWS = _laws()


@dataclass(frozen=True, kw_only=True)
class Setting:
    """What is true of a case beside its effects.

    Parameters
    ----------
    geometry : str
        One of `referee.geometry.NAMES`.
    law : {"ogden", "demiray"}
    shape : tuple of float
        Share of the first term and both exponents, or Demiray's exponent.
    mu : tuple of float
        Shear modulus of each tissue [Pa], in order of label.
    poisson : float
    field_sd, field_length, field_seed
        Of the logarithm of stiffness, beside the mean of each tissue [m].
    total : (x, y, z) or None
        Declared force on the superior cap [N].
    moved : (x, y, z) or None
        Or its declared displacement [m].
    sigma : float
        Of one component of a point [m], and whether the case declares it.
    noise : float
        Factor on all noise, which nobody declares.
    gross : float
        Share of points with gross errors.
    shift, turn : (x, y, z)
        Error of registration [m] and [rad].
    points, checks : int
        How many points are recorded to be fitted, and apart to be compared with.
    surface : bool
        Whether the moved wall of the ventricles is recorded too.
    times : tuple of float
        When points are recorded [s]; empty: no time is told.
    bent : float
        How far the true surface is from the declared one [m], root mean square.
    mispaired : float
        Share of points that have the end of another.
    mesh : str
        The mesh that the case declares.
    seed : int
        Of noise and of where is recorded.
    sites : int, optional
        Seed of where points are recorded, if other cases have the same places.
    """

    geometry: str
    law: str
    shape: tuple[float, ...]
    mu: tuple[float, ...]
    poisson: float
    field_sd: float
    field_length: float
    field_seed: int
    total: tuple[float, float, float] | None
    moved: tuple[float, float, float] | None
    sigma: float
    declares_sigma: bool
    noise: float
    gross: float
    shift: tuple[float, float, float]
    turn: tuple[float, float, float]
    points: int
    checks: int
    surface: bool
    times: tuple[float, ...]
    seed: int
    bent: float = 0.0
    mispaired: float = 0.0
    mesh: str = ""
    sites: int | None = None

    @property
    def outlined(self) -> Body:
        """The true body, were its surface the declared one."""
        return true_body(self.geometry)

    @cached_property
    def body(self) -> Body:
        """The true body."""
        body = self.outlined
        if self.bent == 0.0:
            return body
        # in each direction a part of the whole
        away = self.bent / np.sqrt(3.0) * random_field(body.mesh.points, 0.03, self.seed + 1, 3)
        mesh = body.mesh
        return Body(TetMesh(mesh.points + away, mesh.tetrahedra, mesh.tissue, dict(mesh.node_sets)))

    @property
    def true_law(self) -> Law:
        """Of the tissue."""
        if self.law == "demiray":
            return Demiray(*self.shape)
        share, *exponents = self.shape
        return Ogden((share, 1.0 - share), tuple(exponents))

    @property
    def blur(self) -> Blur:
        """How observation goes wrong."""
        return Blur(
            noise_scale=self.noise * self.sigma / SIGMA,
            shared_sigma=SHARED * SIGMA,
            shared_length=SHARED_LENGTH,
            shift=self.shift,
            rotation=self.turn,
            seed=self.seed,
        )

    def problem(self) -> Problem:
        """The body under what the case declares."""
        body = self.body
        labels = np.unique(body.mesh.tissue)
        mean = np.asarray(self.mu)[np.searchsorted(labels, body.mesh.tissue)]
        mu = (mean * np.exp(self.field_sd * random_field(body.centroids, self.field_length, self.field_seed)[:, 0]))[
            :, None
        ]
        held = body.nodes("fixed") | body.nodes("side")
        value = np.zeros_like(body.points)
        loads: tuple[Load, ...] = ()
        if self.total is not None:
            force = cap_force(body, np.asarray(self.total))
            loads = (lambda u: force,)
        else:
            cap = body.nodes("superior") & ~held
            value[cap] = np.asarray(self.moved)
            held = held | cap
        return Problem(
            body=body,
            law=self.true_law,
            mu=mu,
            bulk=mu * 2.0 * (1.0 + self.poisson) / (3.0 * (1.0 - 2.0 * self.poisson)),
            growth=np.zeros_like(mu),
            held=np.repeat(held[:, None], 3, axis=1),
            value=value,
            loads=loads,
        )

    def described(self) -> dict[str, Any]:
        """Everything of it, for the label."""
        return {name: list(value) if isinstance(value, tuple) else value for name, value in asdict(self).items()}


def random_field(points: Floats, length: float, seed: int, components: int = 1) -> Floats:
    """Gaussian fields (n, components) of mean 0, variance 1 and covariance ``exp(-r^2 / (2 length^2))``.

    Parameters
    ----------
    points : (n, 3) array
        [m]
    length : float
        [m]
    seed : int
        The same field at whatever points.
    components : int
    """
    random = np.random.default_rng(seed)
    out = np.empty((len(points), components))
    for k in range(components):
        waves = random.normal(size=(3, _FEATURES)) / length
        phases = random.uniform(0.0, 2.0 * np.pi, _FEATURES)
        out[:, k] = np.sqrt(2.0 / _FEATURES) * np.cos(points @ waves + phases).sum(axis=1)
    return out


def cap_force(body: Body, total: Floats) -> Floats:
    """Nodal forces [N] of a force on the superior cap, linear between its nodes, of which each has an equal share."""
    cap = body.mesh.node_sets["superior"]
    outer = body.outer
    triangles = outer.nodes[:, :3]
    areas = np.bincount(triangles.ravel(), np.repeat(outer.areas.sum(axis=1) / 3.0, 3), minlength=len(cap))
    density = np.where(cap, 1.0 / cap.sum() / np.where(areas > 0.0, areas, 1.0), 0.0)
    return outer.spread((outer.linear(density) * outer.areas)[..., None] * total)


def draw_setting(random: Random, geometry: str, timed: bool) -> Setting:
    """Draw what is true of a case beside its effects.

    Parameters
    ----------
    random : numpy Generator
    geometry : str
    timed : bool
        Whether points must be recorded at several times; otherwise some cases are too.
    """
    shape: tuple[float, ...]
    if random.random() < 0.5:
        law, shape = "demiray", (float(random.uniform(*DEMIRAY)),)
    else:
        law, shape = "ogden", tuple(float(random.uniform(*ends)) for ends in OGDEN)
    force = timed or random.random() < 0.7
    tilt = random.normal(size=2) * 0.25
    pressed = np.array([*tilt, -1.0])
    amount = random.uniform(1.6, 3.0) if force else random.uniform(0.004, 0.007)
    load = triple(amount * pressed)
    declared = [tissue.known_law.shear_modulus for _, tissue in sorted(declared_case(geometry).tissues.items())]
    mu = np.array(declared) * np.exp(OVERALL * random.normal() + EACH * random.normal(size=len(declared)))
    return Setting(
        geometry=geometry,
        mesh=geometry,
        law=law,
        shape=shape,
        mu=tuple(map(float, mu)),
        poisson=float(random.uniform(*POISSON)),
        field_sd=float(random.uniform(*FIELD)),
        field_length=float(random.choice([random.uniform(*ends) for ends in LENGTHS])),
        field_seed=int(random.integers(2**31)),
        total=load if force else None,
        moved=None if force else load,
        sigma=float(np.round(random.uniform(0.15e-3, 0.30e-3), 6)),
        declares_sigma=bool(random.random() < 0.8),
        noise=float(random.uniform(*NOISE)),
        gross=0.04,
        shift=_within(random, SHIFT),
        turn=_within(random, TURN),
        points=int(random.integers(50, 111)),
        checks=30,
        surface=bool(random.random() < 0.6),
        times=_times(random) if timed or (force and random.random() < 0.25) else (),
        seed=int(random.integers(2**31)),
    )


def _within(random: Random, size: float) -> tuple[float, float, float]:
    return triple(size / np.sqrt(3.0) * random.normal(size=3))


def triple(vector: Floats) -> tuple[float, float, float]:
    """A vector as plain numbers."""
    x, y, z = (float(value) for value in vector)
    return x, y, z


def _times(random: Random) -> tuple[float, ...]:
    first = random.uniform(0.5, 2.0)
    return tuple(float(np.round(first * factor, 2)) for factor in (1.0, 5.0, 25.0))
