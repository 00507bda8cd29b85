"""Stress of a homogeneous state, in closed form or by a few Newton steps for all states of a test at once.

A state is a stretch along z, two lateral ones and a shear of x along z, `F = [[lx, 0, g], [0, ly, 0], [0, 0, lz]]`.
Stresses are slopes of the energy, taken by differences, so that every law of the house is the same to them. Lateral
faces are free: lubricated ends leave `lx` and `ly` to equilibrium. Simple shear prescribes all of `F`.

Memory is a Prony series (`warpbrain.physics.mechanism.Relaxing`), integrated exactly for a stress that goes straight
from row to row (Simo and Hughes, Computational Inelasticity, section 10.3, before its midpoint rule).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.cases.case import Case
from warpbrain.errors import InputError
from warpbrain.physics.laws import Law
from warpbrain.physics.laws.total_energy import total_energy
from warpbrain.physics.mechanism import Mechanism, Relaxing, Storing, Substituting

_STEP = 2e-5
_NEWTON, _TOLERANCE = 60, 1e-9
#: Slope of a branch's lateral stress over its modulus, for Newton steps: near enough to converge.
_BRANCH_SLOPE = 2.0


class NoStateError(Exception):
    """Lateral faces find no equilibrium: the parameters cannot be."""


def can_act(kind: type[Mechanism]) -> bool:
    """Whether a kind of mechanism is known to a homogeneous state."""
    return issubclass(kind, Substituting | Storing | Relaxing)


@dataclass(frozen=True, eq=False)
class HomogeneousMaterial:
    """What a specimen is made of.

    Attributes
    ----------
    law : Law
    poisson : float
    formulation : str
    storing : tuple of Storing
        What stores energy beside the law.
    moduli, times : tuple of float
        Branches of its memory: relative to the law's shear modulus, and [s].
    """

    law: Law
    poisson: float
    formulation: str
    storing: tuple[Storing, ...] = ()
    moduli: tuple[float, ...] = ()
    times: tuple[float, ...] = ()

    @classmethod
    def of_case(cls, case: Case, mechanisms: Sequence[Mechanism], turn: Floats | None = None) -> HomogeneousMaterial:
        """The tissue of a case with all that acts on it, its own mechanisms among that, turned in the machine.

        Raises
        ------
        InputError
            If one of them is not known to a homogeneous state, or parameters make no sense.
        """
        [(label, tissue)] = case.tissues.items()
        law, poisson, formulation = tissue.known_law, case.poisson, tissue.formulation
        material = cls(law, poisson, formulation)
        for given in (*case.mechanisms, *mechanisms):
            mechanism = given if turn is None else given.turned(turn)
            if isinstance(mechanism, Substituting):
                law, poisson, formulation = mechanism.substitute(
                    label, material.law, material.poisson, material.formulation
                )
                material = replace(material, law=law, poisson=poisson, formulation=formulation)
            elif isinstance(mechanism, Relaxing):
                moduli, times = mechanism.branches()
                material = replace(material, moduli=(*material.moduli, *moduli), times=(*material.times, *times))
            elif isinstance(mechanism, Storing):
                material = replace(material, storing=(*material.storing, mechanism))
            else:
                raise InputError(
                    f"{case.path}: [[mechanism]] kind = '{mechanism.kind}': a diagnosis of a specimen has no "
                    "homogeneous state with it"
                )
        return material

    def energy(self, lx: Floats, ly: Floats, lz: Floats, g: Floats) -> Floats:
        """Strain energy [Pa] without memory."""
        # singular values of [[lx, g], [0, lz]]
        apart = np.sqrt(((lx - lz) ** 2 + g**2) * ((lx + lz) ** 2 + g**2))
        first = np.sqrt(0.5 * (lx**2 + lz**2 + g**2 + apart))
        stretches = np.stack([first, ly, lx * lz / first], axis=-1)
        energy = total_energy(self.law, stretches, self.poisson, self.formulation)
        if self.storing:
            F = np.zeros((len(lx), 3, 3))
            F[:, 0, 0], F[:, 1, 1], F[:, 2, 2], F[:, 0, 2] = lx, ly, lz, g
            energy = energy + sum(mechanism.stored_energy(F) for mechanism in self.storing)
        return energy

    def axial(self, stretch: Floats, time: Floats | None) -> Floats:
        """Nominal stress [Pa] along z of states with free lateral faces, one after the other.

        Raises
        ------
        NoStateError
            If lateral faces find no equilibrium.
        """
        g = np.zeros_like(stretch)
        # what is alike across z stays so
        groups = ((0,), (1,)) if self.storing else ((0, 1),)
        lateral = np.repeat(stretch[:, None] ** -self.poisson, 2, axis=1)
        with np.errstate(all="ignore"):
            for _ in range(_NEWTON):
                residual, slope = self._lateral(groups, lateral, stretch, g, time)
                step = np.linalg.solve(slope, residual[..., None])[..., 0]
                step = np.clip(step, -0.2 * lateral.min(), 0.2 * lateral.min())
                for j, group in enumerate(groups):
                    for axis in group:
                        lateral[:, axis] -= step[:, j]
                if not np.isfinite(step).all() or np.abs(step).max() < _TOLERANCE:
                    break
        if not np.isfinite(step).all() or np.abs(step).max() > 1e3 * _TOLERANCE:
            raise NoStateError("lateral faces find no equilibrium")
        lx, ly = lateral.T
        stress = _slope(lambda h: self.energy(lx, ly, stretch + h, g))
        if time is not None and self.times:
            _, _, Szz, _ = self._isochoric(lx, ly, stretch, g)
            stress = stress + stretch * self._held(Szz, time)
        return stress

    def shear(self, shear: Floats, time: Floats | None) -> Floats:
        """Nominal stress [Pa] along x of states in simple shear."""
        unit = np.ones_like(shear)
        stress = _slope(lambda h: self.energy(unit, unit, unit, shear + h))
        if time is not None and self.times:
            _, _, Szz, Sxz = self._isochoric(unit, unit, unit, shear)
            stress = stress + self._held(Sxz, time) + shear * self._held(Szz, time)
        return stress

    def torsion(self, rim: Floats, time: Floats | None) -> Floats:
        """Torque over `int r dA` [Pa] of a cylinder that is twisted by a shear at its rim; radii stay what they are."""
        nodes, weights = np.polynomial.legendre.leggauss(6)
        radii, weights = 0.5 * (nodes + 1.0), 0.5 * weights
        total = sum(w * r**2 * self.shear(rim * r, time) for r, w in zip(radii, weights, strict=True))
        return np.asarray(3.0 * total)

    def confined(self, stretch: Floats, time: Floats | None) -> Floats:
        """Nominal stress [Pa] along z of states that are as wide as at rest."""
        unit, g = np.ones_like(stretch), np.zeros_like(stretch)
        stress = _slope(lambda h: self.energy(unit, unit, stretch + h, g))
        if time is not None and self.times:
            stress = stress + stretch * self._held(self._isochoric(unit, unit, stretch, g)[2], time)
        return stress

    def biaxial(self, stretch: Floats, time: Floats | None) -> Floats:
        """Nominal stress [Pa] along x of states that are stretched alike along x and y, with free faces along z.

        Raises
        ------
        NoStateError
            If these faces find no equilibrium.
        """
        g, thickness = np.zeros_like(stretch), stretch ** (-2.0 * self.poisson / (1.0 - self.poisson))
        remembers, h = time is not None and bool(self.times), _STEP
        with np.errstate(all="ignore"):
            for _ in range(_NEWTON):
                down, middle, up = (self.energy(stretch, stretch, thickness + move, g) for move in (-h, 0.0, h))
                residual, slope = (up - down) / (2.0 * h), (up - 2.0 * middle + down) / h**2
                if time is not None and remembers:
                    S = self._isochoric(stretch, stretch, thickness, g)[2]
                    residual = residual + thickness * self._held(S, time)
                    slope = slope + _BRANCH_SLOPE * self._mu * sum(self.moduli)
                step = np.clip(residual / slope, -0.2 * thickness.min(), 0.2 * thickness.min())
                thickness = thickness - step
                if not np.isfinite(step).all() or np.abs(step).max() < _TOLERANCE:
                    break
        if not np.isfinite(step).all() or np.abs(step).max() > 1e3 * _TOLERANCE:
            raise NoStateError("faces across a sheet find no equilibrium")
        stress = _slope(lambda h: self.energy(stretch + h, stretch, thickness, g))
        if time is not None and remembers:
            stress = stress + stretch * self._held(self._isochoric(stretch, stretch, thickness, g)[0], time)
        return stress

    def stress(self, mode: str, strain: Floats, time: Floats | None) -> Floats:
        """Nominal stress [Pa] of a chain of one mode."""
        by_mode = {"axial": self.axial, "shear": self.shear, "torsion": self.torsion}
        by_mode |= {"confined": self.confined, "biaxial": self.biaxial}
        return by_mode[mode](strain, time)

    def _held(self, S: Floats, time: Floats) -> Floats:
        """What all branches hold (n,) of stresses (n,)."""
        each = (beta * relaxing(S, time, tau) for beta, tau in zip(self.moduli, self.times, strict=True))
        return sum(each, start=np.zeros(len(S)))

    def _isochoric(self, lx: Floats, ly: Floats, lz: Floats, g: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """`S = mu0 J^(-2/3) (I - I1/3 C^-1)`: xx, yy, zz and xz."""
        J, I1 = lx * ly * lz, lx**2 + ly**2 + lz**2 + g**2
        scale = self._mu * J ** (-2.0 / 3.0)
        det = (lx * lz) ** 2
        xx, zz, xz = (g**2 + lz**2) / det, lx**2 / det, -lx * g / det
        return (
            scale * (1.0 - I1 / 3.0 * xx), scale * (1.0 - I1 / 3.0 / ly**2),
            scale * (1.0 - I1 / 3.0 * zz), -scale * I1 / 3.0 * xz,
        )  # fmt: skip

    @cached_property
    def _mu(self) -> float:
        return self.law.shear_modulus

    def _lateral(
        self, groups: tuple[tuple[int, ...], ...], lateral: Floats, stretch: Floats, g: Floats, time: Floats | None
    ) -> tuple[Floats, Floats]:
        """Forces (n, k) on the lateral faces and about how they change with the stretches (n, k, k)."""

        def at(*moves: float) -> Floats:
            stretches = lateral.copy()
            for move, group in zip(moves, groups, strict=True):
                for axis in group:
                    stretches[:, axis] += move
            return self.energy(stretches[:, 0], stretches[:, 1], stretch, g)

        k, h = len(groups), _STEP
        middle = at(*([0.0] * k))
        residual, slope = np.zeros((len(stretch), k)), np.zeros((len(stretch), k, k))
        for i in range(k):
            up, down = at(*(h * np.eye(k)[i])), at(*(-h * np.eye(k)[i]))
            residual[:, i] = (up - down) / (2.0 * h)
            slope[:, i, i] = (up - 2.0 * middle + down) / h**2
        if k == 2:
            mixed = (at(h, h) - at(h, -h) - at(-h, h) + at(-h, -h)) / (4.0 * h**2)
            slope[:, 0, 1] = slope[:, 1, 0] = mixed
        if time is not None and self.times:
            S = self._isochoric(lateral[:, 0], lateral[:, 1], stretch, g)
            for i, group in enumerate(groups):
                for axis in group:
                    residual[:, i] += lateral[:, axis] * self._held(S[axis], time)
                slope[:, i, i] += _BRANCH_SLOPE * len(group) * self._mu * sum(self.moduli)
        return residual, slope


def relaxing(values: Floats, time: Floats, tau: float) -> Floats:
    """What relaxes of values (n,), zero long before the first time, at each time (n,).

    `q_n = exp(-h_n/tau) q_(n-1) + (tau/h_n) (1 - exp(-h_n/tau)) (v_n - v_(n-1))`, all n at once: pairs of factor and
    addend are composed over 1, 2, 4, ... rows (Blelloch 1990, Prefix sums and their applications).
    """
    h = np.diff(time)
    decay = np.concatenate([[0.0], np.exp(-h / tau)])
    q = np.diff(values, prepend=0.0) * np.concatenate([[1.0], -np.expm1(-h / tau) * tau / h])
    step = 1
    while step < len(q):
        q[step:] = q[step:] + decay[step:] * q[:-step]
        decay[step:] = decay[step:] * decay[:-step]
        step *= 2
    return q


def _slope(energy: Callable[[float], Floats]) -> Floats:
    return (energy(_STEP) - energy(-_STEP)) / (2.0 * _STEP)
