"""What a cause does to the tests of a specimen, in one shape for all: mechanisms, and what is no mechanism of a run.

Mechanisms of the registry act through the material. Causes that are none (softening by earlier loading, end friction,
another shape of the law, a drifting zero, unlike specimens) scale the simulated stress or add to it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.inference.causes import Kind
from warpbrain.physics.mechanism import Mechanism
from warpbrain.worlds.specimen.protocol import Protocol


@dataclass(frozen=True, eq=False)
class Baseline:
    """What the case as declared, without any cause, says of the rows of tests.

    Attributes
    ----------
    protocol : Protocol
    elastic : (n,) array
        Stress [Pa] of the case's own law and modulus, ends as the case has them.
    mu : float
        Shear modulus of that law [Pa].
    glued : (n,) array
        Factor of glued ends, of the law that was arrived at: 1 where they are lubricated.
    sticking : callable
        Gives the same (n,) if they are glued.
    """

    protocol: Protocol
    elastic: Floats
    mu: float
    glued: Floats
    sticking: Callable[[], Floats]


@dataclass(frozen=True, eq=False)
class Action:
    """What a cause does: mechanisms of the registry, a factor (n,) on the stress, stress (n,) that is added [Pa].

    `scaled` is added before the stress is scaled by the modulus, `added` after that.
    """

    mechanisms: tuple[Mechanism, ...] = ()
    factor: Floats | None = None
    scaled: Floats | None = None
    added: Floats | None = None


@dataclass(frozen=True, eq=False)
class Variant:
    """One of the ways in which a cause may act, with k coefficients.

    Attributes
    ----------
    act : callable
        From coefficients (k,) and rows to what it does.
    mean, sd : (k,) array
        Of the coefficients at the largest size that is plausible; normal.
    nothing : (k,) array
        Where it does nothing.
    trials : tuple of (m, k) arrays
        Coefficients whose effects, less what nothing does, are the columns of a place: one array a place.
    values : callable
        From coefficients to the numbers that users know.
    one_sign : bool
        Whether only sizes of the sign of the trials do anything.
    region : str
        In which way it acts, in words.
    """

    act: Callable[[Floats, Baseline], Action]
    mean: Floats
    sd: Floats
    nothing: Floats
    trials: tuple[Floats, ...]
    values: Callable[[Floats], tuple[float, ...]]
    one_sign: bool = False
    region: str = ""

    @classmethod
    def of_one(cls, act: Callable[[float, Baseline], Action], sd: float, one_sign: bool, region: str = "") -> Variant:
        """A variant with one coefficient that does nothing at 0 and is its own value."""
        return cls(
            lambda c, rows: act(float(c[0]), rows), np.zeros(1), np.array([sd]), np.zeros(1),
            tuple(np.array([[sign * sd]]) for sign in ((1.0,) if one_sign else (1.0, -1.0))),
            lambda c: (float(c[0]),), one_sign, region,
        )  # fmt: skip

    @classmethod
    def of_columns(cls, act: Callable[[Floats, Baseline], Action], sd: float, count: int) -> Variant:
        """A variant with coefficients that act side by side, each of one size."""
        zero = np.zeros(count)
        values = lambda c: tuple(float(x) for x in c)  # noqa: E731
        return cls(act, zero, np.full(count, sd), zero, (sd * np.eye(count),), values)


@dataclass(frozen=True, eq=False)
class Effect:
    """A cause with all its variants.

    Attributes
    ----------
    name : str
    kind : Kind
    sentence : str
    names, units : tuple of str
        Of what `Variant.values` says.
    variants : tuple of Variant
    runs : bool
        Whether `warpbrain run` can simulate it.
    """

    name: str
    kind: Kind
    sentence: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    variants: tuple[Variant, ...]
    runs: bool = False

    @property
    def places(self) -> tuple[tuple[Variant, Floats], ...]:
        """Every variant with each of its trials, in the order of the places of the cause."""
        return tuple((variant, trial) for variant in self.variants for trial in variant.trials)
