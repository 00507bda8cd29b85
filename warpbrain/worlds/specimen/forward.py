"""What a set of causes says of all tests: its stresses, and how they change with its coefficients."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.cases.case import Case
from warpbrain.physics.mechanism import Mechanism
from warpbrain.worlds.specimen.actions import Action, Baseline, Effect, Variant
from warpbrain.worlds.specimen.glued_ends import GluedEnds
from warpbrain.worlds.specimen.material import HomogeneousMaterial
from warpbrain.worlds.specimen.nuisances import Nuisances
from warpbrain.worlds.specimen.protocol import Protocol

#: Step of differences, in standard deviations.
_STEP = 1e-3
#: Responses that are kept.
_REMEMBERED = 500


@dataclass(frozen=True, eq=False)
class Component:
    """A cause of a fit: it acts in one of its variants, near one of its trials, with one of its sizes.

    Attributes
    ----------
    effect : Effect
    variant : Variant
    trial : (m, k) array
    size : float
    """

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


class Forward:
    """Stresses of causes of one case at the rows of a protocol.

    Parameters
    ----------
    case : Case
    protocol : Protocol
    ends : GluedEnds
    glued : bool
        Whether glued ends are computed; otherwise the state is taken for homogeneous.
    law : HomogeneousMaterial, optional
        Whose factor of glued ends is taken; the declared one if not given.
    shape_of_law : bool
        See `Nuisances`.
    """

    def __init__(
        self,
        case: Case,
        protocol: Protocol,
        ends: GluedEnds,
        glued: bool,
        law: HomogeneousMaterial | None = None,
        shape_of_law: bool = True,
    ) -> None:
        self.case, self.protocol, self.ends, self.glued = case, protocol, ends, glued
        self.shape_of_law = shape_of_law
        declared = HomogeneousMaterial.of_case(case, ())
        self.law = law or declared
        self._responses: dict[str, Floats] = {}
        factor = ends.factor(self.law, protocol) if glued else np.ones(len(protocol))
        # only ends that stick without being glued ask what glued ones would do
        sticking = (lambda: factor) if glued else (lambda: ends.factor(declared, protocol))
        [tissue] = case.tissues.values()
        elastic = self._homogeneous(()) * factor
        self.declared = Baseline(protocol, elastic, tissue.known_law.shear_modulus, factor, sticking)
        self.nuisances = Nuisances(self.declared, shape_of_law)

    def of(
        self,
        protocol: Protocol | None = None,
        law: HomogeneousMaterial | None = None,
        shape_of_law: bool | None = None,
    ) -> Forward:
        """The same at the rows of another protocol, with glued ends of another law, or without the shape of the law."""
        shape = self.shape_of_law if shape_of_law is None else shape_of_law
        return Forward(self.case, protocol or self.protocol, self.ends, self.glued, law or self.law, shape)

    def mechanisms(self, assumed: Sequence[Component], z: Floats) -> tuple[Mechanism, ...]:
        """Of the registry, at coefficients (k,)."""
        return tuple(mechanism for one in self.actions(assumed, z) for mechanism in one.mechanisms)

    def material(self, assumed: Sequence[Component], z: Floats) -> HomogeneousMaterial:
        """Of the tissue, at coefficients (k,)."""
        return HomogeneousMaterial.of_case(self.case, self.mechanisms(assumed, z))

    def stress(self, assumed: Sequence[Component], z: Floats) -> Floats:
        """Nominal stress (n,) at all rows [Pa].

        Raises
        ------
        InputError
            If coefficients make no sense to a mechanism.
        NoStateError
            If there is no state.
        """
        return self.stress_of(self.actions(assumed, z), z)

    def tangent(self, assumed: Sequence[Component], z: Floats, stress: Floats) -> Floats:
        """Change (n, k) of the stress with each coefficient: differences for causes, exact for nuisances."""
        actions = self.actions(assumed, z)
        logs, _, zeros = self.nuisances.split(z)
        scaled = stress - self.nuisances.added @ zeros - _sum([one.added for one in actions], len(stress))
        scale = np.exp(self.nuisances.logarithmic @ logs) * _product([one.factor for one in actions], len(stress))
        columns = [
            self.nuisances.logarithmic * scaled[:, None],
            self.nuisances.scaled * scale[:, None],
            self.nuisances.added,
        ]
        for number in range(len(self.nuisances), len(z)):
            moved = z.copy()
            moved[number] += _STEP
            columns.append(((self.stress(assumed, moved) - stress) / _STEP)[:, None])
        return np.concatenate(columns, axis=1)

    def actions(self, assumed: Sequence[Component], z: Floats) -> list[Action]:
        """What causes do at coefficients (k,)."""
        parts = np.split(z, np.cumsum([len(self.nuisances), *map(len, assumed)])[:-1])[1:]
        return [one.variant.act(one.coefficients(c), self.declared) for one, c in zip(assumed, parts, strict=True)]

    def stress_of(self, actions: Sequence[Action], z: Floats) -> Floats:
        """The stress of what causes do, with the coefficients of nuisances among all (k,)."""
        logs, shapes, zeros = self.nuisances.split(z)
        n = len(self.protocol)
        mechanisms = tuple(mechanism for one in actions for mechanism in one.mechanisms)
        simulated = self._homogeneous(mechanisms) * self.declared.glued if mechanisms else self.declared.elastic
        simulated = simulated + self.nuisances.scaled @ shapes + _sum([one.scaled for one in actions], n)
        scale = np.exp(self.nuisances.logarithmic @ logs) * _product([one.factor for one in actions], n)
        return np.asarray(scale * simulated + self.nuisances.added @ zeros + _sum([one.added for one in actions], n))

    def _homogeneous(self, mechanisms: tuple[Mechanism, ...]) -> Floats:
        key = repr(mechanisms)
        if key not in self._responses:
            found = np.zeros(len(self.protocol))
            for chain in self.protocol.chains:
                test = self.protocol.tests[chain.tests[0]]
                material = HomogeneousMaterial.of_case(self.case, mechanisms, test.turn)
                found[self.protocol.mask(chain.tests)] = material.stress(test.mode, chain.strain, chain.time)
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
