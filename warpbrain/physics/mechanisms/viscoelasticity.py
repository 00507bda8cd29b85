"""Viscoelasticity: stress that relaxes, as a Prony series on the isochoric part (Holzapfel 2000, section 6.10).

`F` is the elastic one where tissue swells, and an inclusion multiplies these stresses too. The case's law is what is
left after a long time. Each branch adds a second Piola-Kirchhoff stress `q_i` that follows the isochoric neo-Hookean
stress of the tissue's shear modulus at rest, `S = mu0 J^(-2/3) (I - I1/3 C^-1)`:

    dq_i/dt + q_i/tau_i = beta_i dS/dt
    q_i(t + h) = exp(-h/tau_i) q_i(t) + beta_i exp(-h/(2 tau_i)) (S(t + h) - S(t))

(Simo and Hughes, Computational Inelasticity, section 10.3), `P = F sum_i q_i`. Second order in `h`. In an equilibrium
everything has relaxed. Within a step the stress has a potential, which a line search needs: with `r_i = beta_i
exp(-h/(2 tau_i))` and `S = 2 dPsi/dC`, `Psi = mu0/2 (J^(-2/3) I1 - 3)`,

    sum_i [ r_i Psi(F) + 1/2 (exp(-h/tau_i) q_i(t) - r_i S(t)) : (C - I) ]
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import combinations
from typing import Any, ClassVar

import numpy as np
import warp as wp

from warpbrain.arrays import Floats
from warpbrain.kernels.invariants import cofactor
from warpbrain.kernels.module import Precision, compiled_module
from warpbrain.kernels.tetrahedron import deformation_gradient, store_blocks, store_forces
from warpbrain.physics.mechanism import Expectation, Mechanism, ParameterError, parameter
from warpbrain.physics.potential import Enters
from warpbrain.physics.proposal import NotTestableError, Proposal, Situation
from warpbrain.physics.term import Body, KernelTerm
from warpbrain.physics.words import HARDLY, Smallest, Value, Values, measured, number, unsure

#: Relaxation times [s] that are looked for, alone and in pairs.
_LOOKED_FOR = (1.0, 3.0, 10.0, 30.0, 100.0, 300.0)
#: Standard deviations of `ln tau`, from one time that is looked for to the next, so that all of them together are even
#: and none pulls a fit, and of the log odds of the first of two branches.
_STEP, _ODDS = 0.5 * math.log(10.0), 1.0
#: The least modulus of all branches together.
_LEAST = 1e-6


@dataclass(frozen=True, kw_only=True)
class Viscoelasticity(Mechanism):
    """Branches of a Prony series, in all tissues."""

    moduli: tuple[float, ...] = parameter(  # `beta_i`
        "Modulus of each branch, relative to the case's own, which is what is left in the end.",
        kind="numbers",
        expectation=Expectation.log_normal(1.0, 2.7),
        adds_up=True,
        typical="0.7 kPa left and 2.0 kPa that relax in 9.7 s (cortex); 0.3 and 0.9 kPa, 14.9 s (corona radiata)",
        source="Budday et al. 2017 (diagnosis design, M8)",
    )
    times: tuple[float, ...] = parameter(  # `tau_i`
        "Relaxation time of each branch.",
        kind="numbers",
        unit="s",
        expectation=Expectation.log_uniform(1.0, 3000.0),
        typical="9.7 s (cortex), 14.9 s (corona radiata)",
        source="Budday et al. 2017 (diagnosis design, M8)",
    )
    kind: ClassVar[str] = "viscoelasticity"
    changes_by_itself: ClassVar[bool] = True
    of_specimens: ClassVar[bool] = True
    enters: ClassVar[Enters] = Enters("energy", "Psi_viscous")
    together: ClassVar[Mapping[str, str]] = {
        "asymmetry": "The branches stay neo-Hookean, of the shear modulus at rest of the new law.",
        "compressibility": "The branches are isochoric: they do not see it.",
        "fibres": "The branches are of the tissue's shear modulus; fibres do not relax.",
        "residual-stress": "The tension does not relax; the branches begin at rest in the imaged shape.",
        "swelling": "The branches remember the stress of `F_e`: swelling that nothing holds strains none of them.",
        "cavity": "What is taken out takes its memory with it.",
    }
    sentence: ClassVar[str] = "Tissue resists fast deformation more than slow, and its stress relaxes."
    example: ClassVar[str] = "viscoelasticity:moduli=1,times=10"
    absence: ClassVar[str] = "viscosity other than damping"
    confused_with: ClassVar[tuple[str, ...]] = ("drainage",)
    needs: ClassVar[tuple[str, ...]] = ("two times or more, or two rates",)

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self.moduli) != len(self.times) or not self.times:
            counts = f"found {len(self.times)}, and {len(self.moduli)} of moduli"
            raise ParameterError("times", f"{counts}: expected one of each for every branch")
        for name in ("moduli", "times"):
            values = getattr(self, name)
            if not all(math.isfinite(value) and value > 0.0 for value in values):
                raise ParameterError(name, f"found {list(values)}, expected positive numbers")

    @classmethod
    def proposals(cls, situation: Situation) -> Sequence[Proposal]:
        """One branch of each time that is looked for, and two of each pair of them.

        Tissue relaxes over decades of time, and a few recorded times tell one or two of these apart. Coefficients are
        the modulus of all branches together, the logarithm of each time, and the log odds of the share that the
        first of two branches has.
        """
        situation.require_new(cls.kind)
        if situation.instants < 2:
            raise NotTestableError(f"needs {cls.needs[0]}")
        alone = [(time,) for time in _LOOKED_FOR]
        return [
            Proposal(
                cls._of_coefficients,
                middle := np.array([0.0, *np.log(times), *np.zeros(len(times) - 1)]),
                # within the minutes that are recorded about as much relaxes as is left
                np.array([1.0, *np.full(len(times), _STEP), *np.full(len(times) - 1, _ODDS)]),
                "fading",
                # all of the case's own modulus, whatever the times
                np.eye(1, len(middle))[0],
                nothing=middle,
                history=_left,
                region="all tissue",
                unscaled=tuple(range(1, len(middle))),
                positive=(0,),
                odds="causes.creep",
            )
            for times in (*alone, *combinations(_LOOKED_FOR, 2))
        ]

    @classmethod
    def size_in_words(cls, values: Values, gravity_axis: tuple[float, float, float] | None = None) -> Sequence[str]:
        clauses = []
        if "moduli" in values:
            moduli = values["moduli"]
            clauses.append(
                f"at first it is {measured(1.0 + moduli.value, moduli.sd)} times as stiff as in the end, whether it "
                "relaxes in one time or in two; what relaxes before the first recording is hardly seen"
            )
        if "times" in values:
            of = "of " if unsure(values["times"]) else ""
            clauses.append(f"if it has one, its relaxation time is {of}{_time_in_words(values['times'])}")
        branches = [(values.get(f"moduli_{branch}"), values.get(f"times_{branch}")) for branch in (1, 2)]
        each = [
            f"{measured(modulus.value, modulus.sd)} within {_time_in_words(time)}"
            for modulus, time in branches
            if modulus is not None and time is not None
        ]
        if each:
            clauses.append(f"if it has two, what relaxes, as a part of that in the end, is {', and '.join(each)}")
        return clauses

    @classmethod
    def smallest_in_words(cls, smallest: Smallest) -> str:
        if not smallest.name.startswith("moduli"):
            return super().smallest_in_words(smallest)
        return f"from a tissue that at first is {number(1.0 + smallest.size)} times as stiff as in the end"

    @classmethod
    def _of_coefficients(cls, c: Floats) -> "Viscoelasticity":
        shares, times = _spectrum(c)
        # the faster branch first
        order = np.argsort(times)
        moduli = max(float(c[0]), _LEAST) * shares
        return cls(moduli=tuple(moduli[order].tolist()), times=tuple(times[order].tolist()))

    def branches(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        return self.moduli, self.times

    def bind(self, body: Body) -> "ViscoelasticTerm":
        return ViscoelasticTerm(body, self)


def _spectrum(c: Floats) -> tuple[Floats, Floats]:
    """Shares and times [s] of the branches of a proposal, (1,) or (2,), from its coefficients."""
    if len(c) == 2:
        return np.ones(1), np.exp(c[1:])
    first = 1.0 / (1.0 + math.exp(-float(c[3])))
    return np.array([first, 1.0 - first]), np.exp(c[1:3])


def _left(c: Floats, time: Floats) -> Floats:
    """Modulus that has not relaxed at times (...) [s], as a proposal has it: that of strain that is held."""
    shares, times = _spectrum(c)
    return np.asarray(c[0] * (np.exp(-time[..., None] / times) @ shares))


def _time_in_words(value: Value) -> str:
    if unsure(value):
        # a number with a spread beyond itself would look like a mistake
        return f"the order of {number(value.value, 1)} {value.unit}, {HARDLY}"
    return measured(value.value, value.sd, value.unit)


class ViscoelasticTerm(KernelTerm):
    """`Viscoelasticity` on a device, with its memory."""

    memory = ("_q", "_S")

    def __init__(self, body: Body, mechanism: Viscoelasticity) -> None:
        made, *kernels = _kernels(body.precision)
        super().__init__(body, body.tetrahedra, kernels, mechanism.factor)
        self.mechanism = mechanism
        mat33, count, branches = body.precision.mat33, len(self.stencils), len(mechanism.times)
        self.elements = np.arange(count)
        self._weights = self.zeros(count, 3)
        self.take_moduli()
        self._decay, self._response = self.zeros(branches), self.zeros(branches)
        self._q, self._S = self.zeros(count, branches, dtype=mat33), self.zeros(count, dtype=mat33)
        b = made()
        b.nodes, b.inverse_edges, b.weights = body.nodes, body.inverse_edges, self._weights
        b.decay, b.response, b.q, b.S_before, b.scale = self._decay, self._response, self._q, self._S, self.scale
        self._inputs = (b,)
        self.forgets_in = min(mechanism.times)

    def set_time_step(self, h: float) -> None:
        times = np.array(self.mechanism.times)
        self._decay.assign(np.exp(-h / times))
        self._response.assign(np.array(self.mechanism.moduli) * np.exp(-0.5 * h / times))

    def take_moduli(self) -> None:
        body = self.body
        volumes = body.stiffness_factors * body.mesh.volumes
        self._weights.assign(np.stack([volumes, body.shear_moduli, body.growth_stretches], axis=1))

    def advance(self, u: wp.array) -> None:
        self._launch(self._kernels[3], u)


@cache
def _kernels(precision: Precision) -> tuple[Any, Any, Any, Any, Any]:
    """What kernels know, and those for forces, with tangent blocks, energies and the end of a step, by element."""
    scalar, vec3, mat33 = precision.scalar, precision.vec3, precision.mat33
    module = compiled_module(f"viscoelasticity_{precision.name}")

    @wp.func
    def isochoric(F: mat33, mu: scalar):
        C = wp.transpose(F) * F
        J = wp.determinant(F)
        root = wp.cbrt(J)
        I1 = wp.trace(C)
        return mu / (root * root) * (wp.identity(n=3, dtype=scalar) - I1 / scalar(3.0) * wp.inverse(C))

    @wp.func
    def moduli(F: mat33, S: mat33, q: mat33, mu: scalar, response: scalar, g: vec3, h: vec3):
        """`g . dP/dF . h`: of the isochoric law times the response, with `q` in the place of its stress."""
        cof = cofactor(F)
        J = wp.dot(F[0], cof[0])
        I1 = wp.ddot(F, F)
        root = wp.cbrt(J)
        twice_d1 = mu / (root * root)
        d1J = -twice_d1 / (scalar(3.0) * J)
        dJ = d1J * I1
        dJJ = scalar(-5.0) / scalar(3.0) * dJ / J
        f, fh, c, ch = F * g, F * h, cof * g, cof * h
        K = scalar(2.0) * d1J * (wp.outer(f, ch) + wp.outer(c, fh))
        K += (dJJ + dJ / J) * wp.outer(c, ch) - dJ / J * wp.outer(ch, c)
        isotropic = response * (twice_d1 * wp.dot(g, h) - wp.dot(g, S * h)) + wp.dot(g, q * h)
        return response * K + isotropic * wp.identity(n=3, dtype=scalar)

    @wp.struct
    class Branches:
        nodes: wp.array[wp.vec4i]
        inverse_edges: wp.array[mat33]
        weights: wp.array2d[scalar]
        decay: wp.array[scalar]
        response: wp.array[scalar]
        q: wp.array2d[mat33]
        S_before: wp.array[mat33]
        scale: wp.array[scalar]

    @wp.kernel(module=module)
    def forces(b: Branches, u: wp.array[vec3], element_forces: wp.array2d[vec3]):
        e = wp.tid()
        G = b.inverse_edges[e]
        s = b.weights[e, 2]
        F = deformation_gradient(u, b.nodes[e], G) / s
        change = isochoric(F, b.weights[e, 1]) - b.S_before[e]
        total = mat33()
        for k in range(b.decay.shape[0]):
            total += b.decay[k] * b.q[e, k] + b.response[k] * change
        store_forces(b.scale[0] * b.weights[e, 0] * s * s * (F * total), G, element_forces, e)

    @wp.kernel(module=module)
    def tangents(b: Branches, u: wp.array[vec3], element_forces: wp.array2d[vec3], element_blocks: wp.array2d[mat33]):
        e = wp.tid()
        G = b.inverse_edges[e]
        s = b.weights[e, 2]
        F = deformation_gradient(u, b.nodes[e], G) / s
        mu = b.weights[e, 1]
        S = isochoric(F, mu)
        total = mat33()
        all = scalar(0.0)
        for k in range(b.decay.shape[0]):
            total += b.decay[k] * b.q[e, k] + b.response[k] * (S - b.S_before[e])
            all += b.response[k]
        V = b.scale[0] * b.weights[e, 0] * s
        store_forces(V * s * (F * total), G, element_forces, e)
        a1, a2, a3 = G[0], G[1], G[2]
        store_blocks(
            V * moduli(F, S, total, mu, all, a1, a1),
            V * moduli(F, S, total, mu, all, a1, a2),
            V * moduli(F, S, total, mu, all, a1, a3),
            V * moduli(F, S, total, mu, all, a2, a2),
            V * moduli(F, S, total, mu, all, a2, a3),
            V * moduli(F, S, total, mu, all, a3, a3),
            element_blocks,
            e,
        )

    @wp.kernel(module=module)
    def advance(b: Branches, u: wp.array[vec3]):
        e = wp.tid()
        S = isochoric(deformation_gradient(u, b.nodes[e], b.inverse_edges[e]) / b.weights[e, 2], b.weights[e, 1])
        for k in range(b.decay.shape[0]):
            b.q[e, k] = b.decay[k] * b.q[e, k] + b.response[k] * (S - b.S_before[e])
        b.S_before[e] = S

    @wp.kernel(module=module)
    def energies(b: Branches, u: wp.array[vec3], energy: wp.array[scalar]):
        e = wp.tid()
        s = b.weights[e, 2]
        F = deformation_gradient(u, b.nodes[e], b.inverse_edges[e]) / s
        root = wp.cbrt(wp.determinant(F))
        psi = scalar(0.5) * b.weights[e, 1] * (wp.ddot(F, F) / (root * root) - scalar(3.0))
        strain = wp.transpose(F) * F - wp.identity(n=3, dtype=scalar)
        total = scalar(0.0)
        for k in range(b.decay.shape[0]):
            kept = b.decay[k] * b.q[e, k] - b.response[k] * b.S_before[e]
            total += b.response[k] * psi + scalar(0.5) * wp.ddot(kept, strain)
        energy[e] = b.scale[0] * b.weights[e, 0] * s * s * s * total

    return Branches, forces, tangents, energies, advance
