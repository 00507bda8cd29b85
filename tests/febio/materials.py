"""What FEBio's materials are in warpbrain: a law, and what is added to it.

FEBio User's Manual, version 4, chapter 4. Shipped are the laws `NeoHookean`, `MooneyRivlin` and `Ogden` and the
mechanisms `ResidualStress` and `Swelling`; the rest is in `febio.laws`.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from febio import anisotropic, laws
from febio.problem import Problem
from febio.reader import UnsupportedError
from warpbrain.physics.laws import NeoHookean, Ogden
from warpbrain.physics.mechanism import Mechanism
from warpbrain.physics.mechanisms.residual_stress import ResidualStress
from warpbrain.physics.mechanisms.swelling import Swelling
from warpbrain.physics.mechanisms.viscoelasticity import Viscoelasticity
from warpbrain.simulation.model import Material

#: FEBio's generic laws are texts; these are the ones known here: the law, and its parameters by the names in the text.
TEXTS = {
    "mu*((I1-3)/2-ln(J))+lam*ln(J)*ln(J)/2": ("neo-Hookean", {"mu": "mu", "lam": "lam"}),
    "c1*(I1-3)+c2*(I2-3)": ("Mooney-Rivlin", {"c1": "c1", "c2": "c2"}),
}


@dataclass(frozen=True)
class Constitution:
    """A material of warpbrain's with what acts in it."""

    material: Material
    mechanisms: tuple[Mechanism, ...] = ()

    @property
    def shipped(self) -> bool:
        """Whether all of it is warpbrain's own."""
        mine = (self.material.law, *self.mechanisms)
        return all(type(part).__module__.startswith("warpbrain.") for part in mine)


def constitution(problem: Problem, name: str, time: float) -> Constitution:
    """Of a material of a problem, with the values of its load curves at a time.

    Raises
    ------
    UnsupportedError
        If warpbrain has nothing of this kind.
    """
    return _Reading(problem, time).of(problem.materials[name])


def direction(parameters: Mapping[str, Any]) -> np.ndarray:
    """First axis of a material."""
    given = parameters.get("fiber", parameters.get("mat_axis", {"type": "vector", "a": [1.0, 0.0, 0.0]}))
    if given["type"] == "angles":
        theta, phi = np.radians([given["theta"], given["phi"]])
        return np.array([np.cos(theta) * np.sin(phi), np.sin(theta) * np.sin(phi), np.cos(phi)])
    if given["type"] != "vector":
        raise UnsupportedError(f"axes by {given['type']}")
    return np.array(given["value"] if "value" in given else given["a"], dtype=float)


def _frame(parameters: Mapping[str, Any]) -> np.ndarray:
    """Axes of a material as rows."""
    a = direction(parameters)
    d = np.array(parameters.get("mat_axis", {}).get("d", [0.0, 1.0, 0.0]), dtype=float)
    third = np.cross(a, d)
    rows = np.array([a, np.cross(third, a), third])
    return rows / np.linalg.norm(rows, axis=1, keepdims=True)


def _others(a: np.ndarray) -> np.ndarray:
    """Two directions across one."""
    return np.linalg.svd(np.atleast_2d(a))[2][1:]


class _Reading:
    def __init__(self, problem: Problem, time: float) -> None:
        self.problem, self.time = problem, time

    def number(self, value: Any) -> float:
        if isinstance(value, Mapping):
            return float(value["value"]) * self.problem.factor(value["curve"], self.time)
        return float(value)

    def of(self, m: Mapping[str, Any]) -> Constitution:
        kind = m["type"]
        method = getattr(self, "_" + kind.lower().replace(" ", "_").replace("-", "_"), None)
        if method is None:
            raise UnsupportedError(f"material {kind}")
        made: Constitution = method(m)
        return made

    def bulk(self, m: Mapping[str, Any]) -> laws.Added:
        # a pressure that FEBio iterates (`laugon`) is taken to its end, where the volume stays
        stiffer = 1e4 if m.get("laugon") else 1.0
        return laws.volumetric(stiffer * self.number(m["k"]), m.get("pressure_model", "default"))

    # -- laws --------------------------------------------------------------------------------------------------------

    def _neo_hookean(self, m: Mapping[str, Any]) -> Constitution:
        E, nu = self.number(m["E"]), self.number(m["v"])
        return Constitution(Material(NeoHookean(0.5 * E / (1.0 + nu)), nu))

    def _hyperelastic(self, m: Mapping[str, Any]) -> Constitution:
        (mu, lam) = _of_text(m["W"], "neo-Hookean")
        return Constitution(Material(NeoHookean(mu), 0.5 * lam / (lam + mu)))

    def _uncoupled_hyperelastic(self, m: Mapping[str, Any]) -> Constitution:
        c1, c2 = _of_text(m["W"], "Mooney-Rivlin")
        return self._mooney_rivlin({**m, "c1": c1, "c2": c2})

    def _mooney_rivlin(self, m: Mapping[str, Any]) -> Constitution:
        law = laws.IsochoricMooneyRivlin(self.number(m["c1"]), self.number(m["c2"]))
        return Constitution(Material(law, formulation="uncoupled"), (self.bulk(m),) if "k" in m else ())

    def _terms(self, m: Mapping[str, Any]) -> tuple[tuple[float, ...], tuple[float, ...]]:
        pairs = [(self.number(m[f"c{i}"]), self.number(m[f"m{i}"])) for i in range(1, 7) if m.get(f"c{i}")]
        return tuple(c / a for c, a in pairs), tuple(a for _, a in pairs)

    def _ogden(self, m: Mapping[str, Any]) -> Constitution:
        law = laws.IsochoricOgden(*self._terms(m))
        return Constitution(Material(law, formulation="uncoupled"), (self.bulk(m),))

    def _ogden_unconstrained(self, m: Mapping[str, Any]) -> Constitution:
        volume = laws.volumetric(self.number(m["cp"]), "Abaqus")
        return Constitution(Material(Ogden(*self._terms(m)), 0.0), (volume,))

    def _holmes_mow(self, m: Mapping[str, Any]) -> Constitution:
        E, nu = self.number(m["E"]), self.number(m["v"])
        lam = E * nu / ((1.0 + nu) * (1.0 - 2.0 * nu))
        return Constitution(Material(laws.HolmesMow(0.5 * E / (1.0 + nu), lam, self.number(m["beta"]))))

    def _uncoupled_holmes_mow(self, m: Mapping[str, Any]) -> Constitution:
        law = laws.IsochoricHolmesMow(self.number(m["mu"]), self.number(m["beta"]))
        return Constitution(Material(law, formulation="uncoupled"), (self.bulk(m),))

    def _arruda_boyce(self, m: Mapping[str, Any]) -> Constitution:
        law = laws.IsochoricArrudaBoyce(self.number(m["mu"]), self.number(m["N"]))
        return Constitution(Material(law, formulation="uncoupled"), (self.bulk(m),))

    def _porous_neo_hookean(self, m: Mapping[str, Any]) -> Constitution:
        solid = self.number(m["phi0"])
        mu = self.number(m["E"]) / 3.0 * (1.0 + 0.5 * (1.0 - solid) ** 2)
        return Constitution(Material(laws.PorousNeoHookean(mu, solid)))

    def orthotropic_row(self, m: Mapping[str, Any]) -> tuple[float, ...]:
        E = np.array([self.number(m[f"E{i}"]) for i in (1, 2, 3)])
        G = np.array([self.number(m[f"G{ij}"]) for ij in (12, 23, 31)])
        nu = np.array([self.number(m[f"v{ij}"]) for ij in (12, 23, 31)])
        return anisotropic.orthotropic_row(_frame(m), E, G, nu, self.number(m.get("c", 0.0)))

    def _orthotropic_elastic(self, m: Mapping[str, Any]) -> Constitution:
        return _added(anisotropic.orthotropic(self.orthotropic_row(m)))

    def _fung_ortho_compressible(self, m: Mapping[str, Any]) -> Constitution:
        return _added(anisotropic.orthotropic(self.orthotropic_row(m)), self.bulk(m))

    def _fung_orthotropic(self, m: Mapping[str, Any]) -> Constitution:
        return _added(anisotropic.isochoric_orthotropic(self.orthotropic_row(m)), self.bulk(m))

    def _isotropic_elastic(self, m: Mapping[str, Any]) -> Constitution:
        E, nu = self.number(m["E"]), self.number(m["v"])
        each = np.full(3, 1.0)
        row = anisotropic.orthotropic_row(np.eye(3), E * each, 0.5 * E / (1.0 + nu) * each, nu * each)
        return _added(anisotropic.orthotropic(row))

    def _muscle_material(self, m: Mapping[str, Any]) -> Constitution:
        keys = ("g1", "g2", "p1", "p2", "Lofl", "lam_max", "smax")
        return _added(anisotropic.muscle(direction(m), *(self.number(m[key]) for key in keys)), self.bulk(m))

    def _trans_iso_mooney_rivlin(self, m: Mapping[str, Any]) -> Constitution:
        if "active_contraction" in m:
            raise UnsupportedError("active contraction that depends on calcium")
        base = self._mooney_rivlin(m)
        toe = [self.number(m[key]) for key in ("c3", "c4", "c5", "lam_max")]
        return Constitution(base.material, (*base.mechanisms, laws.fibre(direction(m), 1, *toe)))

    def _2d_trans_iso_mooney_rivlin(self, m: Mapping[str, Any]) -> Constitution:
        """Twelve fibres in the plane of x and y share `c3` and `c5`."""
        base = self._mooney_rivlin(m)
        c3, c4, c5, lam_max = (self.number(m[key]) for key in ("c3", "c4", "c5", "lam_max"))
        angles = 2.0 * np.pi * np.arange(12) / 12.0
        around = [laws.fibre(np.array([np.cos(t), np.sin(t), 0.0]), 1, c3 / 12, c4, c5 / 12, lam_max) for t in angles]
        return Constitution(base.material, (*base.mechanisms, *around))

    def _tc_nonlinear_orthotropic(self, m: Mapping[str, Any]) -> Constitution:
        base = self._mooney_rivlin(m)
        powers = zip(_frame(m), m["ksi"], m["beta"], strict=True)
        return Constitution(base.material, (*base.mechanisms, *(laws.fibre(a, 2, xi, beta) for a, xi, beta in powers)))

    # -- what is made of several ---------------------------------------------------------------------------------------

    def _solid_mixture(self, m: Mapping[str, Any]) -> Constitution:
        # a Newtonian viscous solid carries nothing once the body is at rest
        first, *others = sorted(
            (solid for solid in m["solids"] if not solid["type"].startswith("Newtonian viscous")),
            key=lambda solid: solid["type"].endswith("contraction"),
        )
        base = self.of(first)
        added = [mechanism for other in others for mechanism in self._tension(other)]
        return Constitution(base.material, (*base.mechanisms, *added))

    def _uncoupled_solid_mixture(self, m: Mapping[str, Any]) -> Constitution:
        return self._solid_mixture({"solids": [{**solid, "k": m["k"]} for solid in m["solids"]]})

    def _tension(self, m: Mapping[str, Any]) -> list[Mechanism]:
        # in an uncoupled mixture it is not made deviatoric: it is the same tension
        kind = m["type"].removeprefix("uncoupled ")
        if not (kind.startswith("prescribed ") and kind.endswith(" active contraction")):
            raise UnsupportedError(f"material {m['type']} in a mixture")
        T0, a = self.number(m["T0"]), direction(m)
        axes = {"isotropic": np.eye(3), "uniaxial": a[None], "trans iso": _others(a)}[kind.split(" ", 1)[1][:-19]]
        return [ResidualStress(tension=T0, direction=tuple(axis)) for axis in axes]

    def _kinematic_growth(self, m: Mapping[str, Any]) -> Constitution:
        growth = m["growth"]
        stretch = self.number(growth["multiplier"])
        base = self.of(m["elastic"])
        if growth["type"] == "volume growth":
            return Constitution(base.material, (*base.mechanisms, Swelling(amount=stretch**3 - 1.0)))
        along = np.outer(a := direction(growth), a)
        # the multiplier is that of an area, or of the length of the fibres
        kinds = {"area growth": np.sqrt(stretch) * (np.eye(3) - along) + along}
        kinds["fiber growth"] = np.eye(3) + (stretch - 1.0) * along
        if growth["type"] not in kinds or base.mechanisms or not isinstance(base.material.law, NeoHookean):
            raise UnsupportedError(growth["type"])
        mu, lam = base.material.law.shear_modulus, base.material.volumetric_modulus
        return _added(anisotropic.grown(mu, lam, kinds[growth["type"]]))

    def _rodriguez_growth(self, m: Mapping[str, Any]) -> Constitution:
        return self._kinematic_growth(m)

    def _viscoelastic(self, m: Mapping[str, Any]) -> Constitution:
        base = self.of(m["elastic"])
        branches = [(self.number(m[f"g{i}"]), self.number(m[f"t{i}"])) for i in range(1, 7) if m.get(f"g{i}")]
        moduli, times = zip(*branches, strict=True)
        return Constitution(base.material, (*base.mechanisms, Viscoelasticity(moduli=moduli, times=times)))


def _added(*mechanisms: Mechanism) -> Constitution:
    """A material of which all is added, with an uncoupled `U(J)` if that is among it."""
    uncoupled = any(laws.is_volumetric(mechanism) for mechanism in mechanisms)
    material = Material(laws.Nothing(1.0), formulation="uncoupled" if uncoupled else "coupled")
    return Constitution(material, mechanisms)


def _of_text(text: str, law: str) -> tuple[float, ...]:
    """Parameters of a law that is given as a text."""
    *settings, formula = (part.replace(" ", "") for part in text.split(";"))
    values = dict(setting.split("=") for setting in settings)
    kind, names = TEXTS.get(formula, ("", {}))
    if kind != law:
        raise UnsupportedError(f"the energy {formula}")
    return tuple(float(values[name]) for name in names.values())
