"""What a hypothesis says of all tests: its stresses, and how they change with its coefficients."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpbrain.cases.case import Case
from warpbrain.diagnosis.specimen.acting import Acting, Assumption, Unit
from warpbrain.diagnosis.specimen.material import HomogeneousMaterial
from warpbrain.diagnosis.specimen.nuisances import Nuisances
from warpbrain.diagnosis.specimen.protocol import Protocol
from warpbrain.diagnosis.specimen.shape import Shape
from warpbrain.physics.mechanism import Mechanism

Floats = NDArray[np.float64]

_STEP = 1e-3
#: Responses that are kept, and how little a factor of glued ends may change to be the same.
_REMEMBERED, _SAME = 2000, 0.01


@dataclass(frozen=True)
class Hypothesis:
    """What is assumed beside the case itself.

    Attributes
    ----------
    assumptions : tuple of Assumption
    shape_of_law : bool
        See `Nuisances`.
    """

    assumptions: tuple[Assumption, ...] = ()
    shape_of_law: bool = True

    @property
    def kinds(self) -> tuple[str, ...]:
        """Of the assumptions."""
        return tuple(assumption.kind for assumption in self.assumptions)

    def with_more(self, assumption: Assumption) -> Hypothesis:
        """One assumption more."""
        return Hypothesis((*self.assumptions, assumption), self.shape_of_law)


class Forward:
    """Stresses of hypotheses of one case.

    Parameters
    ----------
    case : Case
    protocol : Protocol
    device : str, optional
        Of the finite elements that glued ends need.
    ends : bool
        Whether glued ends are computed; otherwise the state is taken for homogeneous.
    """

    def __init__(self, case: Case, protocol: Protocol, device: str | None = None, ends: bool = True) -> None:
        assert case.specimen is not None
        self.case, self.protocol = case, protocol
        self._glued = case.specimen.grips == "glued" and ends
        self.shape = Shape(case, protocol, device)
        self._responses: dict[tuple[str, ...], Floats] = {}
        declared = HomogeneousMaterial.of_case(case, ())
        self.use_shape_of(declared)
        self._nuisances: dict[bool, Nuisances] = {}

    def use_shape_of(self, material: HomogeneousMaterial) -> bool:
        """Take the factor of glued ends of a law from now on; whether that changes it."""
        before = getattr(self, "unit", None)
        if before is not None and not self._glued:
            return False
        declared = HomogeneousMaterial.of_case(self.case, ())
        glued = self._factor(material) if self._glued else np.ones(len(self.protocol))
        # only a hypothesis of ends that stick asks what lubricated ones would do then
        sticking = (lambda: glued) if self._glued else (lambda: self._factor(declared))
        [tissue] = self.case.tissues.values()
        self.unit = Unit(
            self.protocol, tissue.known_law.shear_modulus, self._homogeneous(declared) * glued, glued, sticking
        )
        self._nuisances = {}
        return before is None or float(np.abs(before.glued - glued).max()) > _SAME

    def _factor(self, material: HomogeneousMaterial) -> Floats:
        curves = self.shape.curves(material)
        return np.concatenate([curves[test.mode].at(test.strain) for test in self.protocol.tests])

    def nuisances(self, hypothesis: Hypothesis) -> Nuisances:
        """Of a hypothesis."""
        kind = hypothesis.shape_of_law
        if kind not in self._nuisances:
            self._nuisances[kind] = Nuisances(self.protocol, self.unit, kind)
        return self._nuisances[kind]

    def size(self, hypothesis: Hypothesis) -> int:
        """Coefficients of a hypothesis."""
        return len(self.nuisances(hypothesis)) + sum(len(one.mean) for one in hypothesis.assumptions)

    def coefficients(self, hypothesis: Hypothesis, z: Floats) -> list[Floats]:
        """Of each assumption, in its own units."""
        found, first = [], len(self.nuisances(hypothesis))
        for one in hypothesis.assumptions:
            found.append(one.mean + one.sd * z[first : first + len(one.mean)])
            first += len(one.mean)
        return found

    def material(self, hypothesis: Hypothesis, z: Floats) -> HomogeneousMaterial:
        """Of the tissue, at coefficients (k,)."""
        return HomogeneousMaterial.of_case(self.case, self.mechanisms(hypothesis, z))

    def mechanisms(self, hypothesis: Hypothesis, z: Floats) -> tuple[Mechanism, ...]:
        """Of the registry, at coefficients (k,)."""
        acting = self._acting(hypothesis, z)
        return tuple(mechanism for one in acting for mechanism in one.mechanisms)

    def stress(self, hypothesis: Hypothesis, z: Floats) -> Floats:
        """Nominal stress (n,) at all rows [Pa].

        Raises
        ------
        InputError
            If coefficients make no sense to a mechanism.
        NoStateError
            If there is no state.
        """
        return self._stress(self.nuisances(hypothesis), z, self._acting(hypothesis, z))

    def tangent(self, hypothesis: Hypothesis, z: Floats, stress: Floats) -> Floats:
        """Change (n, k) of the stress with each coefficient: differences for assumptions, exact for nuisances."""
        nuisances = self.nuisances(hypothesis)
        acting = self._acting(hypothesis, z)
        logs, _, zeros = nuisances.split(z)
        own = stress - nuisances.added @ zeros - _sum([one.added for one in acting], len(stress))
        scale = np.exp(nuisances.logarithmic @ logs) * _product([one.factor for one in acting], len(stress))
        columns = [nuisances.logarithmic * own[:, None], nuisances.scaled * scale[:, None], nuisances.added]
        for number in range(len(nuisances), len(z)):
            moved = z.copy()
            moved[number] += _STEP
            columns.append(((self.stress(hypothesis, moved) - stress) / _STEP)[:, None])
        return np.concatenate(columns, axis=1)

    def _acting(self, hypothesis: Hypothesis, z: Floats) -> list[Acting]:
        pairs = zip(hypothesis.assumptions, self.coefficients(hypothesis, z), strict=True)
        return [one.act(c, self.unit) for one, c in pairs]

    def _stress(self, nuisances: Nuisances, z: Floats, acting: Sequence[Acting]) -> Floats:
        logs, shapes, zeros = nuisances.split(z)
        n = len(self.protocol)
        mechanisms = tuple(mechanism for one in acting for mechanism in one.mechanisms)
        simulated = self._simulated(mechanisms) + nuisances.scaled @ shapes + _sum([one.scaled for one in acting], n)
        scale = np.exp(nuisances.logarithmic @ logs) * _product([one.factor for one in acting], n)
        return scale * simulated + nuisances.added @ zeros + _sum([one.added for one in acting], n)

    def _simulated(self, mechanisms: tuple[Mechanism, ...]) -> Floats:
        if not mechanisms:
            return self.unit.base
        return self._homogeneous(HomogeneousMaterial.of_case(self.case, mechanisms)) * self.unit.glued

    def _homogeneous(self, material: HomogeneousMaterial) -> Floats:
        key = (repr((material.law, material.poisson, material.fibres, material.moduli, material.times)),)
        if key not in self._responses:
            found = np.zeros(len(self.protocol))
            for chain in self.protocol.chains:
                mode = self.protocol.tests[chain.tests[0]].mode
                found[self.protocol.mask(chain.tests)] = material.stress(mode, chain.strain, chain.time)
            if len(self._responses) > _REMEMBERED:
                self._responses.clear()
            self._responses[key] = found
        return self._responses[key]


def _sum(columns: Sequence[Floats | None], n: int) -> Floats:
    return sum((column for column in columns if column is not None), start=np.zeros(n))


def _product(columns: Sequence[Floats | None], n: int) -> Floats:
    found = np.ones(n)
    for column in columns:
        if column is not None:
            found = found * column
    return found
