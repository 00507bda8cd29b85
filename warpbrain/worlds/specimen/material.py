"""Stress of a homogeneous state, in closed form or by a few Newton steps for all states of a test at once.

A state is a stretch along each axis and a shear of x along z, `F = [[lx, 0, g], [0, ly, 0], [0, 0, lz]]`. Stresses are
slopes of the energy, taken by differences, so that every law of the house is the same to them. Stretches of free faces
are left to equilibrium.

Memory is a Prony series (`warpbrain.physics.mechanism.Relaxing`), integrated exactly for a stress that goes straight
from row to row (Simo and Hughes, Computational Inelasticity, section 10.3, before its midpoint rule).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.cases.case import Case
from warpbrain.errors import InputError
from warpbrain.physics.laws import Law
from warpbrain.physics.laws.stability import total_energy
from warpbrain.physics.mechanism import Mechanism, Relaxing, Storing, Substituting

_STEP = 2e-5
_NEWTON, _TOLERANCE = 60, 1e-9
#: Slope of a branch's stress across over its modulus, for Newton steps: near enough to converge.
_BRANCH_SLOPE = 2.0


class NoStateError(Exception):
    """Free faces find no equilibrium: the parameters cannot be."""


def can_act(kind: type[Mechanism]) -> bool:
    """Whether a kind of mechanism is known to a homogeneous state."""
    return issubclass(kind, Substituting | Storing | Relaxing)


@dataclass(frozen=True, eq=False)
class HomogeneousMaterial:
    """What a specimen is made of."""

    law: Law
    poisson: float
    formulation: str
    storing: tuple[Storing, ...] = ()  # what stores energy beside the law
    #: Branches of its memory: relative to the law's shear modulus, and [s].
    moduli: tuple[float, ...] = ()
    times: tuple[float, ...] = ()

    @classmethod
    def of_case(cls, case: Case, mechanisms: Sequence[Mechanism], turn: Floats | None = None) -> HomogeneousMaterial:
        """The tissue of a case with all that acts on it, its own mechanisms among that, turned in the machine.

        `InputError` if one of them is not known to a homogeneous state, or parameters make no sense.
        """
        [(label, tissue)] = case.tissues.items()
        material = cls(tissue.known_law, case.poisson, tissue.formulation)
        for declared in (*case.mechanisms, *mechanisms):
            mechanism = declared if turn is None else declared.turned(turn)
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

    def stress(self, mode: str, strain: Floats, time: Floats | None) -> Floats:
        """Nominal stress (n,) [Pa] of states one after the other; without times [s] nothing relaxes.

        The mode is ``"axial"``, with free lateral faces, ``"confined"``, as wide as at rest, ``"biaxial"``, stretched
        alike along x and y, ``"shear"``, or ``"torsion"``, of which the strain is the shear at the rim and the stress
        the torque over `int r dA`. Raises `NoStateError` if free faces find no equilibrium.
        """
        if mode == "shear":
            return self._shear(strain, time)
        if mode == "torsion":
            # radii stay what they are
            nodes, weights = np.polynomial.legendre.leggauss(6)
            radii, weights = 0.5 * (nodes + 1.0), 0.5 * weights
            total = sum(w * r**2 * self._shear(strain * r, time) for r, w in zip(radii, weights, strict=True))
            return np.asarray(3.0 * total)
        unit, axis = np.ones_like(strain), 2
        if mode == "confined":
            stretches = np.column_stack([unit, unit, strain])
        elif mode == "axial":
            across = strain**-self.poisson
            # what is alike across z stays so
            free: tuple[tuple[int, ...], ...] = ((0,), (1,)) if self.storing else ((0, 1),)
            stretches = self._settled(np.column_stack([across, across, strain]), free, time)
        else:
            across, axis = strain ** (-2.0 * self.poisson / (1.0 - self.poisson)), 0
            stretches = self._settled(np.column_stack([strain, strain, across]), ((2,),), time)
        stress = _slope(lambda h: self._energy(stretches + h * np.eye(3)[axis]))
        if time is not None and self.times:
            stress = stress + strain * self._held(self._isochoric(stretches)[axis], time)
        return stress

    def _shear(self, shear: Floats, time: Floats | None) -> Floats:
        unit = np.ones((len(shear), 3))
        stress = _slope(lambda h: self._energy(unit, shear + h))
        if time is not None and self.times:
            _, _, Szz, Sxz = self._isochoric(unit, shear)
            stress = stress + self._held(Sxz, time) + shear * self._held(Szz, time)
        return stress

    def _energy(self, stretches: Floats, g: Floats | float = 0.0) -> Floats:
        """Strain energy (n,) [Pa] without memory, of stretches (n, 3) and shears."""
        lx, ly, lz = stretches.T
        # singular values of [[lx, g], [0, lz]]
        apart = np.sqrt(((lx - lz) ** 2 + g**2) * ((lx + lz) ** 2 + g**2))
        first = np.sqrt(0.5 * (lx**2 + lz**2 + g**2 + apart))
        principal = np.stack([first, ly, lx * lz / first], axis=-1)
        energy = total_energy(self.law, principal, self.poisson, self.formulation)
        if self.storing:
            F = np.zeros((len(lx), 3, 3))
            F[:, 0, 0], F[:, 1, 1], F[:, 2, 2], F[:, 0, 2] = lx, ly, lz, g
            energy = energy + sum(mechanism.stored_energy(F) for mechanism in self.storing)
        return energy

    def _held(self, S: Floats, time: Floats) -> Floats:
        """What all branches hold (n,) of stresses (n,)."""
        each = (beta * relaxing(S, time, tau) for beta, tau in zip(self.moduli, self.times, strict=True))
        return sum(each, start=np.zeros(len(S)))

    def _isochoric(self, stretches: Floats, g: Floats | float = 0.0) -> tuple[Floats, Floats, Floats, Floats]:
        """`S = mu0 J^(-2/3) (I - I1/3 C^-1)`: xx, yy, zz and xz."""
        lx, ly, lz = stretches.T
        J, I1 = lx * ly * lz, lx**2 + ly**2 + lz**2 + g**2
        scale = self.law.shear_modulus * J ** (-2.0 / 3.0)
        det = (lx * lz) ** 2
        xx, zz, xz = (g**2 + lz**2) / det, lx**2 / det, -lx * g / det
        return (
            scale * (1.0 - I1 / 3.0 * xx), scale * (1.0 - I1 / 3.0 / ly**2),
            scale * (1.0 - I1 / 3.0 * zz), -scale * I1 / 3.0 * xz,
        )  # fmt: skip

    def _settled(self, stretches: Floats, free: tuple[tuple[int, ...], ...], time: Floats | None) -> Floats:
        """Stretches (n, 3) at which nothing pulls along the free axes; those of a group are alike."""
        faces = [axis for group in free for axis in group]
        with np.errstate(all="ignore"):
            for _ in range(_NEWTON):
                force, slope = self._forces(stretches, free, time)
                step = np.linalg.solve(slope, force[..., None])[..., 0]
                most = 0.2 * stretches[:, faces].min()
                step = np.clip(step, -most, most)
                for group, move in zip(free, step.T, strict=True):
                    stretches[:, group] -= move[:, None]
                if not np.isfinite(step).all() or np.abs(step).max() < _TOLERANCE:
                    break
        if not np.isfinite(step).all() or np.abs(step).max() > 1e3 * _TOLERANCE:
            raise NoStateError("free faces find no equilibrium")
        return stretches

    def _forces(
        self, stretches: Floats, free: tuple[tuple[int, ...], ...], time: Floats | None
    ) -> tuple[Floats, Floats]:
        """Forces (n, k) on the free faces, and about how they change with their stretches (n, k, k)."""
        k, h = len(free), _STEP
        axes = np.array([np.isin(np.arange(3), group) for group in free], dtype=float)

        def at(*moves: float) -> Floats:
            return self._energy(stretches + np.array(moves) @ axes)

        middle = at(*np.zeros(k))
        force, slope = np.zeros((len(stretches), k)), np.zeros((len(stretches), k, k))
        for i, move in enumerate(h * np.eye(k)):
            up, down = at(*move), at(*-move)
            force[:, i] = (up - down) / (2.0 * h)
            slope[:, i, i] = (up - 2.0 * middle + down) / h**2
        if k == 2:
            mixed = (at(h, h) - at(h, -h) - at(-h, h) + at(-h, -h)) / (4.0 * h**2)
            slope[:, 0, 1] = slope[:, 1, 0] = mixed
        if time is not None and self.times:
            S = self._isochoric(stretches)
            for i, group in enumerate(free):
                for axis in group:
                    force[:, i] += stretches[:, axis] * self._held(S[axis], time)
                slope[:, i, i] += _BRANCH_SLOPE * len(group) * self.law.shear_modulus * sum(self.moduli)
        return force, slope


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
