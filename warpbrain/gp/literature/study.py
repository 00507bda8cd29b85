"""One published strain energy."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from warpbrain.gp.literature.conventions import Parameters
from warpbrain.gp.literature.energies import Floats
from warpbrain.gp.literature.forms import FORMS
from warpbrain.gp.literature.groups import task_of


@dataclass(frozen=True)
class Study:
    """A strain energy of one study, on the incompressible uniaxial path `(l, l^-1/2, l^-1/2)`.

    Attributes
    ----------
    name : str
        As in the paper's Table 1.
    group : str
        Method and anatomy, one of `warpbrain.gp.literature.groups.GROUPS`.
    form : str
        One of `warpbrain.gp.literature.forms.FORMS`.
    compression, tension : mapping of str to float or tuple of float
        Parameters of the form for `l <= 1` and `l >= 1` (moduli in Pa); the same unless the study fitted them apart.
    stretch : tuple of float
        Range (low, high) of `l` for which it speaks, around 1.
    source : str
        The paper as far as it is known, and where the numbers were read.
    convention : str
        In which its numbers are given, one of the form's; `compression` and `tension` are in ours.
    checked : str
        What is known about the agreement with the printed paper.
    note : str
        What else should be known.
    reason : str or None
        Why it differs from what the paper trained on; None if it does not.
    number : int or None
        `n` in the paper's Table 1.
    """

    name: str
    group: str
    form: str
    compression: Parameters
    tension: Parameters
    stretch: tuple[float, float]
    source: str = ""
    convention: str = ""
    checked: str = ""
    note: str = ""
    reason: str | None = None
    number: int | None = None

    @property
    def task(self) -> int:
        """Number of its group, 0 to 11."""
        return task_of(self.group)

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
    def parameters(self) -> Parameters | dict[str, Parameters]:
        """Parameters of the form; of a study that is split, both sets by the names of their sides."""
        return {"compression": self.compression, "tension": self.tension} if self.split else self.tension

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
