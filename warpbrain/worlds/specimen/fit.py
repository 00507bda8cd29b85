"""What a set of causes says of all tests, and its most probable coefficients without linearising.

    stress = exp(m) prod_s exp(v_s) (simulated + second invariant) x factors + zero offsets + drifts

What may explain a difference before any cause is credited with it is always there, each with the size that it is known
to have (`priors.toml`), a coefficient that is normal with mean 0 and standard deviation 1: the modulus `m`, specimens
of one tissue, what glued ends do, a law that stiffens a little (a factor on all of the stress, what it remembers among
it) or depends on the second invariant, the zero of a gauge and its drift.

The least-squares loop of the house (`warpbrain.inference.least_squares`) leads to the most probable coefficients.
About them the rows are a `GaussianModel`, whose log density is the evidence (Laplace's approximation); the scale of the
noise is the most probable one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import prod

import numpy as np

from warpbrain.arrays import Bools, Floats
from warpbrain.cases.case import Case
from warpbrain.errors import InputError
from warpbrain.inference.beliefs import belief
from warpbrain.inference.gaussian import GaussianModel
from warpbrain.inference.least_squares import minimise
from warpbrain.inference.noise import scales
from warpbrain.physics.mechanism import Mechanism
from warpbrain.worlds.specimen.effects import Action, Effect, Variant, excess_rows, invariant_rows, specimen_rows
from warpbrain.worlds.specimen.glued_ends import GluedEnds
from warpbrain.worlds.specimen.material import HomogeneousMaterial, NoStateError
from warpbrain.worlds.specimen.protocol import Protocol, noise_factor

#: Step of differences, in standard deviations; responses that are kept.
_STEP, _REMEMBERED = 1e-3, 500
#: Steps at most, and length of the one [standard deviations] that is not worth it; how often a fit is repeated with the
#: scale of the noise, and with the glued ends of the law, that it arrived at.
_STEPS, _AT_BEST, _SETTLING = 30, 1e-3, 3
#: What causes raise whose coefficients cannot be.
CANNOT_BE = (InputError, NoStateError, OverflowError, np.linalg.LinAlgError, ValueError)
#: Relative change of the factor of glued ends that is none.
_SAME = 0.01


@dataclass(frozen=True, eq=False)
class Component:
    """A cause of a fit: it acts in one of its variants, near one of its trials (m, k), with one of its sizes."""

    effect: Effect
    variant: Variant
    trial: Floats
    size: float

    def __len__(self) -> int:
        return len(self.variant.mean)

    @property
    def sd(self) -> Floats:
        """Standard deviations (k,) of the coefficients: the size is of those by which it does something."""
        sized = np.any(self.trial != self.variant.nothing, axis=0)
        return np.where(sized, self.size, 1.0) * self.variant.sd

    def coefficients(self, z: Floats) -> Floats:
        """Coefficients (k,) from standard deviations (k,)."""
        c = np.asarray(self.variant.mean + self.sd * z)
        if not self.variant.one_sign:
            return c
        # half of a normal distribution, folded: where it does nothing it has a slope
        move = self.trial[0] - self.variant.nothing
        return np.where(move != 0.0, self.variant.nothing + np.sign(move) * np.abs(c - self.variant.nothing), c)


@dataclass(eq=False)
class Forward:
    """Stresses of causes of one case at the rows of a protocol; its length is the number of nuisances, of `names`.

    With `glued` the `factor` (n,) of glued ends is that of a law, the declared one if none is given; otherwise the
    state is taken for homogeneous. Without `shape_of_law` nuisances are those of a run, whose law and ends are the
    case's. They change the logarithm of all stress (`logarithmic` (n, k)), the simulated stress before it is scaled
    (`scaled`), or what is `added` after that [Pa].
    """

    case: Case
    protocol: Protocol
    ends: GluedEnds
    glued: bool
    law: HomogeneousMaterial | None = None
    shape_of_law: bool = True

    def __post_init__(self) -> None:
        self._declared = HomogeneousMaterial.of_case(self.case, ())
        law = self.law or self._declared
        self.factor = self.ends.factor(law, self.protocol) if self.glued else np.ones(len(self.protocol))
        self._responses: dict[str, Floats] = {}
        [tissue] = self.case.tissues.values()
        self.mu = tissue.known_law.shear_modulus
        self._set_nuisances()

    def __len__(self) -> int:
        return len(self.names)

    @cached_property
    def sticking(self) -> Floats:
        """Factor (n,) of ends that stick, glued or not."""
        return self.factor if self.glued else self.ends.factor(self._declared, self.protocol)

    @cached_property
    def noise(self) -> Floats:
        """Factor (n, n) of the noise."""
        return noise_factor(self.protocol)

    def _set_nuisances(self) -> None:
        protocol, shape = self.protocol, self.shape_of_law
        logs, names = [belief("specimen.modulus") * np.ones(len(protocol))], ["modulus"]
        if len(protocol.specimens) > 1:
            logs += list(belief("specimen.specimens") * specimen_rows(protocol).T)
            names += [f"specimen {name}" for name in protocol.specimens]
        if shape:
            kI = belief("specimen.stiffening") * invariant_rows(protocol)
            logs.append(kI / (1.0 + kI))
            names.append("stiffening")
            if bool(np.any(self.factor != 1.0)):
                # 1 standard deviation leaves a homogeneous state
                logs.append(-belief("specimen.ends") * np.log(self.factor))
                names.append("ends that hold less")
        self.logarithmic = np.column_stack(logs)
        second = belief("specimen.second_invariant") * excess_rows(self)
        self.scaled = second[:, None] if shape else np.zeros((len(protocol), 0))
        names += ["second invariant"] if shape else []
        added = []
        for number, test in enumerate(protocol.tests):
            zero = test.peak * protocol.mask([number])
            added.append(belief("specimen.zero") * zero)
            names.append(f"zero of {test.name}")
            if test.time is not None:
                zero[protocol.rows[number]] *= test.share - 0.5
                added.append(belief("specimen.drift") * zero)
                names.append(f"drift in {test.name}")
        self.added, self.names = np.column_stack(added), tuple(names)

    def modulus(self, z: Floats) -> float:
        """Factor on the modulus at coefficients (k,)."""
        return float(np.exp(belief("specimen.modulus") * z[0]))

    def mechanisms(self, assumed: Sequence[Component], z: Floats) -> tuple[Mechanism, ...]:
        """Of the registry, at coefficients (k,)."""
        return tuple(mechanism for action in self.actions(assumed, z) for mechanism in action.mechanisms)

    def material(self, assumed: Sequence[Component], z: Floats) -> HomogeneousMaterial:
        """Of the tissue, at coefficients (k,)."""
        return HomogeneousMaterial.of_case(self.case, self.mechanisms(assumed, z))

    def stress(self, assumed: Sequence[Component], z: Floats) -> Floats:
        """Nominal stress (n,) at all rows [Pa]; raises `InputError` if a mechanism cannot be, or `NoStateError`."""
        return self.stress_of(self.actions(assumed, z), z)

    def actions(self, assumed: Sequence[Component], z: Floats) -> list[Action]:
        """What causes do at coefficients (k,)."""
        parts = np.split(z, np.cumsum([len(self), *map(len, assumed)])[:-1])[1:]
        return [each.variant.act(each.coefficients(c), self) for each, c in zip(assumed, parts, strict=True)]

    def stress_of(self, actions: Sequence[Action], z: Floats) -> Floats:
        """The stress of what causes do, with the coefficients of nuisances among all (k,)."""
        scale, shapes, added = self._nuisances(actions, z)
        simulated = self._homogeneous(tuple(m for action in actions for m in action.mechanisms)) * self.factor
        simulated = simulated + self.scaled @ shapes + sum(action.scaled for action in actions)
        return np.asarray(scale * simulated + added)

    def tangent(self, assumed: Sequence[Component], z: Floats, stress: Floats) -> Floats:
        """Change (n, k) of the stress with each coefficient: differences for causes that do not only add stress."""
        scale, _, added = self._nuisances(self.actions(assumed, z), z)
        of_law = self.logarithmic * (stress - added)[:, None], self.scaled * scale[:, None]
        adds, columns = self.adding(assumed)
        tangent = np.empty((len(stress), len(z)))
        tangent[:, : len(self) - self.added.shape[1]] = np.concatenate(of_law, axis=1)
        tangent[:, adds] = columns
        for number in np.flatnonzero(~adds[len(self) :]) + len(self):
            moved = self.stress(assumed, z + _STEP * np.eye(len(z))[number])
            tangent[:, number] = (moved - stress) / _STEP
        return tangent

    def adding(self, assumed: Sequence[Component]) -> tuple[Bools, Floats]:
        """Which coefficients (k,) only add stress, and what one of each of these adds (n, a) [Pa]."""
        adds, columns = [np.arange(len(self)) >= len(self) - self.added.shape[1]], [self.added]
        for component in assumed:
            adds.append(np.full(len(component), component.variant.added is not None))
            if component.variant.added is not None:
                columns.append(component.variant.added(self.protocol) * component.sd)
        return np.concatenate(adds), np.concatenate(columns, axis=1)

    def _nuisances(self, actions: Sequence[Action], z: Floats) -> tuple[Floats, Floats, Floats]:
        """Factor (n,) on the simulated stress, coefficients of the law's shape, and all that is added (n,)."""
        a = self.logarithmic.shape[1]
        b = a + self.scaled.shape[1]
        scale = np.exp(self.logarithmic @ z[:a]) * prod(action.factor for action in actions)
        return scale, z[a:b], self.added @ z[b : len(self)] + sum(action.added for action in actions)

    def _homogeneous(self, mechanisms: tuple[Mechanism, ...]) -> Floats:
        key = repr(mechanisms)
        if key not in self._responses:
            each = []
            for chain in self.protocol.chains:
                test = self.protocol.tests[chain.tests[0]]
                material = HomogeneousMaterial.of_case(self.case, mechanisms, test.turn)
                each.append(material.stress(test.mode, chain.strain, chain.time))
            if len(self._responses) > _REMEMBERED:
                self._responses.clear()
            self._responses[key] = np.concatenate(each)
        return self._responses[key]


@dataclass(frozen=True, eq=False)
class Fit:
    """Causes at their most probable coefficients `z` (k,), in standard deviations, after some of the `rows` (n,).

    `stress` (n,) [Pa] and its change `columns` (n, k) with each coefficient are of all rows of the protocol, fitted or
    not; `log_density` is of the fitted ones at this `scale` of the noise, with the scale's log probability.
    """

    forward: Forward
    assumed: tuple[Component, ...]
    rows: Bools
    z: Floats
    stress: Floats
    columns: Floats
    scale: float
    log_density: float

    @property
    def names(self) -> frozenset[str]:
        """Of its causes."""
        return frozenset(component.effect.name for component in self.assumed)

    @cached_property
    def residual(self) -> Floats:
        """Observed less computed (n,) with all coefficients at zero, to first order [Pa]."""
        return self.forward.protocol.observed - self.stress + self.columns @ self.z

    @cached_property
    def model(self) -> GaussianModel:
        """Of the residual at the fitted rows."""
        return GaussianModel(self.forward.noise[np.ix_(self.rows, self.rows)], self.columns[self.rows], self.scale)

    @cached_property
    def covariance(self) -> Floats:
        """Of the coefficients (k, k)."""
        return self.model.coefficients(self.residual[self.rows])[1]

    def refitted_to(self, rows: Bools) -> Fit:
        """The same causes fitted to other rows (n,), with its noise and glued ends; itself where no fit stands."""
        try:
            return _fit(self.forward, self.assumed, self.z, self.scale, rows)
        except CANNOT_BE:
            return self

    def part(self, number: int) -> slice:
        """Coefficients of one of the causes."""
        first = len(self.forward) + sum(map(len, self.assumed[:number]))
        return slice(first, first + len(self.assumed[number]))

    def only(self, kept: Callable[[Effect], bool]) -> tuple[tuple[Component, ...], Floats]:
        """Some of its causes, and their coefficients (k,)."""
        numbers = [k for k, component in enumerate(self.assumed) if kept(component.effect)]
        z = np.concatenate([np.zeros(0), *(self.z[self.part(k)] for k in numbers)])
        return tuple(self.assumed[k] for k in numbers), z


def fit(forward: Forward, assumed: tuple[Component, ...], z: Floats, scale: float = 1.0) -> Fit | None:
    """Fit causes to all rows that may be fitted, from coefficients (k,) and a scale of the noise; None if none stands.

    The noise and the glued ends are those of what is arrived at.
    """
    settled = None
    for _ in range(_SETTLING):
        try:
            again = _fit(forward, assumed, z, scale, forward.protocol.fitted)
            law = forward.material(assumed, again.z)
        except CANNOT_BE:
            return settled
        moved = replace(forward, law=law) if forward.glued else forward
        same_ends = float(np.abs(moved.factor - forward.factor).max()) <= _SAME
        settled = again
        if again.scale == scale and same_ends:
            break
        z, scale = again.z, again.scale
        forward = forward if same_ends else moved
    return settled


def _fit(forward: Forward, assumed: tuple[Component, ...], z: Floats, scale: float, rows: Bools) -> Fit:
    """A fit with one scale of the noise and the glued ends of one law; raises one of `CANNOT_BE` if none stands."""
    observed = forward.protocol.observed
    # what only adds stress is linear: it is integrated out while all else is searched for
    adds, added = forward.adding(assumed)
    noise = GaussianModel(forward.noise[np.ix_(rows, rows)], added[rows], scale)

    def whole(at: Floats) -> Floats:
        z = np.zeros(len(adds))
        z[~adds] = at
        return z

    def standardised(at: Floats) -> Floats:
        return np.concatenate([noise.standardised((observed - forward.stress(assumed, whole(at)))[rows]), at])

    def slopes(at: Floats) -> Floats:
        tangent = forward.tangent(assumed, whole(at), forward.stress(assumed, whole(at)))
        return np.concatenate([-noise.standardised(tangent[rows][:, ~adds]), np.eye(len(at))])

    with np.errstate(all="ignore"):
        at, _ = minimise(standardised, slopes, z[~adds], _AT_BEST, cannot_be=CANNOT_BE, evaluations=_STEPS)
    z = whole(at)
    z[adds] = noise.coefficients((observed - forward.stress(assumed, z))[rows])[0]
    stress = forward.stress(assumed, z)
    columns = forward.tangent(assumed, z, stress)
    residual = (observed - stress + columns @ z)[rows]
    model = noise.of_noise(columns[rows])
    values, logs = scales()
    each = []
    for kappa, log_prior in zip(values.tolist(), logs.tolist(), strict=True):
        at_scale = model.with_scale(kappa)
        each.append(log_prior + float(at_scale.log_density(residual)) - _beyond(at_scale, residual, z))
    best = int(np.argmax(each))
    return Fit(forward, assumed, rows, z, stress, columns, float(values[best]), each[best])


def _beyond(model: GaussianModel, residual: Floats, z: Floats) -> float:
    """What the linear model promises beyond `z` [nats]: at a limit of a parameter there is no such better point."""
    mean, covariance = model.coefficients(residual)
    return float(0.5 * (z - mean) @ np.linalg.solve(covariance, z - mean))
