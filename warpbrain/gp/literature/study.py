"""One published strain energy, the twelve groups that such studies are of, and the points that they make.

A strain energy is seen as the neo-Hookean one of the same value, too: on the path `Psi = mu I(l)` is one, with
`I(l) = (l^2 + 2/l - 3) / 2`. Dividing any other energy by `I` leaves the secant shear modulus `mu(l)`, smooth through
`l = 1`, where energies vanish and their logarithms do not exist. Its logarithm `z` is what the hierarchical model
describes: constant for a neo-Hookean solid, curved for one that stiffens.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from warpbrain.arrays import Floats, Ints
from warpbrain.gp.literature.forms import FORMS, Parameters, first

#: How a study measured, in the paper's order: elastography, linear elasticity, hyperelasticity.
METHODS = ("MRE", "linear", "hyperelastic")
#: What it measured, in the paper's order.
ANATOMIES = ("grey matter", "white matter", "brain", "abnormal")
#: Names of the groups; the place of a name is its task, `4 method + anatomy`, 0 to 11, as the paper numbers them.
GROUPS = tuple(f"{method}/{anatomy}" for method in METHODS for anatomy in ANATOMIES)

#: Stretches (low, high) on which the paper samples a group: what a study gets that names none.
STRETCHES: dict[str, tuple[float, float]] = {
    **{f"MRE/{anatomy}": (0.95, 1.05) for anatomy in ANATOMIES},
    **{f"linear/{anatomy}": (0.9, 1.1) for anatomy in ANATOMIES},
    "hyperelastic/grey matter": (0.9, 1.1),
    "hyperelastic/white matter": (0.9, 1.1),
    "hyperelastic/brain": (0.6, 1.4),
    "hyperelastic/abnormal": (0.8, 1.2),
}
#: Added to an energy before its logarithm is taken [Pa].
OFFSET = 1e-4


@dataclass(frozen=True)
class Study:
    """A strain energy of one study, on the incompressible uniaxial path `(l, l^-1/2, l^-1/2)`."""

    name: str  # as in the paper's Table 1
    group: str  # method and anatomy, one of `GROUPS`
    form: str  # one of `warpbrain.gp.literature.forms.FORMS`
    compression: Parameters  # of the form for `l <= 1`, moduli in Pa
    tension: Parameters  # for `l >= 1`; the same unless the study fitted them apart
    stretch: tuple[float, float]  # range of `l` for which it speaks, around 1
    source: str = ""  # the paper as far as it is known, and where the numbers were read
    convention: str = ""  # in which its numbers are given, one of the form's; the parameters are in ours
    checked: str = ""  # what is known about the agreement with the printed paper
    note: str = ""  # what else should be known
    reason: str | None = None  # why it differs from what the paper trained on; None if it does not
    number: int | None = None  # `n` in the paper's Table 1

    @property
    def task(self) -> int:
        """Number of its group, 0 to 11."""
        return GROUPS.index(self.group)

    @property
    def paper(self) -> str:
        """What its name ends with if that is an author and a year, as in "MRE-WM-Kruse1999"; else all of its name.

        Studies of one paper share what a laboratory does to its numbers.
        """
        last = self.name.rpartition("-")[2]
        return last if re.fullmatch(r"[^\W\d]+\d{4}", last) else self.name

    @property
    def split(self) -> bool:
        """Whether compression and tension were fitted apart."""
        return self.compression != self.tension

    @property
    def symmetric(self) -> bool:
        """Whether it is a function of I1 alone for both sides, which takes tension and compression alike."""
        return FORMS[self.form].of_first_invariant and not self.split

    @property
    def shear_moduli(self) -> tuple[float, float]:
        """Shear modulus at rest `mu0` [Pa] in compression and in tension."""
        modulus = FORMS[self.form].shear_modulus
        return modulus(**self.compression), modulus(**self.tension)

    def energy(self, stretches: ArrayLike) -> Floats:
        """Strain energy [Pa] at stretches `l` > 0 of any shape, inside the study's range or not.

        Examples
        --------
        >>> study = Study("mine", "hyperelastic/brain", "neo-hookean", {"mu": 600.0}, {"mu": 600.0}, (0.9, 1.1))
        >>> float(study.energy(2.0))
        600.0
        """
        l = np.asarray(stretches, dtype=np.float64)
        form = FORMS[self.form]
        if not self.split:
            return form.energy(l, **self.tension)
        # each side only where it holds: the other may overflow there
        below = form.energy(np.minimum(l, 1.0), **self.compression)
        return np.where(l < 1.0, below, form.energy(np.maximum(l, 1.0), **self.tension))

    def grid(self, count: int = 100) -> Floats:
        """Stretches at which the paper evaluates it: `count` equally spaced ones, (count,).

        A study that is split gets half of them on each side, so that `l = 1` is there twice, as in the paper.
        """
        low, high = self.stretch
        if not self.split:
            return np.linspace(low, high, count)
        half = count // 2
        return np.concatenate([np.linspace(low, 1.0, half), np.linspace(1.0, high, count - half)])

    @property
    def hyperelastic(self) -> bool:
        """Whether it published a curve: elastography and linear studies publish a modulus."""
        return self.group.startswith("hyperelastic/")


def groups_of(studies: Sequence[Study]) -> tuple[str, ...]:
    """The groups that studies are of, in the paper's order."""
    seen = {study.group for study in studies}
    return tuple(group for group in GROUPS if group in seen)


def dataset(studies: Sequence[Study], count: int = 100) -> tuple[Ints, Floats, Floats]:
    """Group 0 to 11, stretch and `y = ln(Psi + 1e-4)` of `count` points for each study (`Study.grid`); (n,) each."""
    grids = [study.grid(count) for study in studies]
    energies = [study.energy(grid) for study, grid in zip(studies, grids, strict=True)]
    groups = np.repeat(np.array([study.task for study in studies], dtype=np.int64), count)
    nothing = np.empty(0)
    return groups, np.concatenate([*grids, nothing]), np.log(np.concatenate([*energies, nothing]) + OFFSET)


def invariant(stretches: ArrayLike) -> Floats:
    """`I(l) = (I1 - 3) / 2 = (l^2 + 2/l - 3) / 2`, all digits of which are kept near 1."""
    return 0.5 * first(np.asarray(stretches, dtype=np.float64))


def equivalent_strain(stretches: ArrayLike) -> Floats:
    """`e(l) = sgn(l - 1) sqrt(2 I / 3)`, which is `l - 1` near rest; of equal size where both sides have one I1."""
    l = np.asarray(stretches, dtype=np.float64)
    return np.asarray((l - 1.0) * np.sqrt((l + 2.0) / (3.0 * l)))


def stretch_of(strains: ArrayLike) -> Floats:
    """The stretch of an equivalent strain `e`: the root of `l^3 - 3 (1 + e^2) l + 2 = 0` on the side of `e`."""
    e = np.asarray(strains, dtype=np.float64)
    # Vieta's cosine, written from rest, where its arc cosine would lose half the digits
    third = np.arctan(e * np.sqrt(3.0 + 3.0 * e**2 + e**4)) / 3.0
    return np.asarray(np.sqrt(1.0 + e**2) * (np.cos(third) + np.sqrt(3.0) * np.sin(third)))


def log_secant_modulus(stretches: ArrayLike, energies: ArrayLike) -> Floats:
    """`z = ln(Psi / I)` with moduli in Pa, at stretches other than 1."""
    return np.log(np.asarray(energies, dtype=np.float64) / invariant(stretches))


def log_energy(stretches: ArrayLike, log_modulus: ArrayLike) -> Floats:
    """`y = ln(Psi + 1e-4)`, as the paper trains on it, of `z`; any stretches > 0."""
    return np.log(invariant(stretches) * np.exp(np.asarray(log_modulus, dtype=np.float64)) + OFFSET)
