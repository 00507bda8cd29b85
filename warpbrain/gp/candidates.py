"""Models that are compared by what they say of studies they have not seen.

Every candidate predicts the log energies `y = ln(Psi + 1e-4)` of a study of a group, at any stretch, one by one. The
coregionalised ones learn from 20 points a study here, not 100, so that each can be trained again for every study that
is left out; each training goes on from the one on all studies. A group of which the only study is left out keeps the
parameters that it had with it: a favour to these models, which could not predict it otherwise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from scipy.special import logsumexp, ndtr

from warpbrain.arrays import Floats
from warpbrain.gp.coregionalised import Coregionalised, training_points
from warpbrain.gp.hierarchical import Hierarchical
from warpbrain.gp.hierarchy import CENTRE, MEAN_ASYMMETRY, SAMPLE, fit_hierarchy, observations, sample_hierarchies
from warpbrain.gp.likelihood import TASKS, Likelihood
from warpbrain.gp.literature.study import OFFSET, Study
from warpbrain.gp.secant import invariant, log_secant_modulus
from warpbrain.gp.training import JITTER, climb, start, train

#: Name of the model that ships as the default.
DEFAULT = "hierarchical (the default)"
#: Of each study, for the coregionalised candidates.
POINTS = 20
#: Effects that a hierarchical candidate can lack.
OF_PAPERS = ("paper", "curve, paper", "asymmetry, paper", "asymmetry at rest, paper")
OF_CURVES = (
    *("curve", "curve, anatomy", "curve, paper", "curve, study"),
    *("asymmetry, paper", "asymmetry, study", "asymmetry at rest, paper", "asymmetry at rest, study"),
)


@dataclass(frozen=True, eq=False)
class Prediction:
    """Of one study that was left out, (n,) each.

    The log density of each of its log energies by itself [nats], their probability integral transforms (how probable it
    was held to be that they are lower), and log energy minus predicted mean.
    """

    log_density: Floats
    pit: Floats
    error: Floats


class Candidate(Protocol):
    """A kind of model, fitted or not."""

    @property
    def name(self) -> str:
        """What it is, in a few words."""

    def fitted(self, studies: Sequence[Study]) -> Candidate:
        """The same kind fitted to studies, from where it stands."""

    def predict(self, study: Study, stretches: Floats) -> Prediction:
        """What it says of a study that it was not fitted to."""

    def level_pit(self, studies: Sequence[Study], stretches: Sequence[Floats]) -> float:
        """How probable it holds it to be that studies which it was not fitted to are softer in the mean.

        The level is the mean log energy over the stretches of a study, and over studies. Points of a study, and studies
        of a paper, are no independent witnesses of a model's calibration; levels of papers are.
        """


@dataclass(frozen=True, eq=False)
class CoregionalisedCandidate:
    """The paper's process, or one like it: `separate` groups share nothing but a length scale."""

    name: str
    kernel: str = "matern32"
    mean_modulus: float = 0.0
    separate: bool = False
    #: None before the first fit.
    model: Coregionalised | None = None

    def fitted(self, studies: Sequence[Study]) -> CoregionalisedCandidate:
        data = training_points(studies, self.mean_modulus, POINTS)
        likelihood = Likelihood(data, self.kernel, JITTER)
        if self.model is not None:
            parameters = climb(likelihood, self.model.parameters, 1e-2, 60).parameters
        elif self.separate:
            # no gradient leads away from w = 0
            apart = replace(start(data), w=np.zeros(TASKS), kappa=np.full(TASKS, 1e2))
            parameters = climb(likelihood, apart, 1e-3, 300).parameters
        else:
            parameters = train(data, self.kernel, step=1, gain=1e-3).best.parameters
        model = Coregionalised(tuple(studies), parameters, "", self.kernel, JITTER, self.mean_modulus, POINTS)
        return replace(self, model=model)

    def predict(self, study: Study, stretches: Floats) -> Prediction:
        assert self.model is not None
        mean, spread = self.model.log_energy(study.group, stretches)
        error = np.log(study.energy(stretches) + OFFSET) - mean
        return Prediction(_normal(error, spread), ndtr(error / spread), error)

    def level_pit(self, studies: Sequence[Study], stretches: Sequence[Floats]) -> float:
        assert self.model is not None
        mean, spread = self.model.level_of(studies, stretches)
        pairs = zip(studies, stretches, strict=True)
        level = np.mean([np.log(study.energy(l) + OFFSET).mean() for study, l in pairs])
        return float(ndtr((level - mean) / spread))


@dataclass(frozen=True, eq=False)
class HierarchicalCandidate:
    """The hierarchical model, or one that is `without` some of its effects, averaged over a sample of hierarchies.

    A sample of 0 is the best hierarchy alone.
    """

    name: str
    kernel: str = "matern52"
    without: tuple[str, ...] = ()
    mean_asymmetry: tuple[float, float] = MEAN_ASYMMETRY
    sample: int = SAMPLE
    #: None before the first fit.
    model: Hierarchical | None = None

    def fitted(self, studies: Sequence[Study]) -> HierarchicalCandidate:
        first = None if self.model is None else self.model.hierarchy
        seen = observations(studies)
        hierarchy, _ = fit_hierarchy(seen, self.kernel, first, self.without, self.mean_asymmetry)
        sample = sample_hierarchies(hierarchy, seen, self.sample) if self.sample else ()
        return replace(self, model=Hierarchical(tuple(studies), hierarchy, "", sample))

    def predict(self, study: Study, stretches: Floats) -> Prediction:
        assert self.model is not None
        moments = self.model.moduli_of([study], [stretches])
        means = np.array([mean for mean, _ in moments])
        spreads = np.sqrt([np.diag(covariance) for _, covariance in moments])
        energy, core = study.energy(stretches), invariant(stretches)
        errors = np.log(energy / core) - means
        # the density of y = ln(Psi + 1e-4) is that of z = ln(Psi / I) times dz/dy
        slope = np.log((energy + OFFSET) / energy)
        density = logsumexp(_normal(errors, spreads), axis=0) - np.log(len(moments))
        away = np.log(energy + OFFSET) - np.log(core * np.exp(means.mean(axis=0)) + OFFSET)
        return Prediction(density + slope, ndtr(errors / spreads).mean(axis=0), away)

    def level_pit(self, studies: Sequence[Study], stretches: Sequence[Floats]) -> float:
        """See `Candidate`; of log secant moduli, which differ from log energies by what is known."""
        assert self.model is not None
        moduli = [log_secant_modulus(l, study.energy(l)) for study, l in zip(studies, stretches, strict=True)]
        level = np.mean([of_study.mean() for of_study in moduli])
        weights = np.concatenate([np.full(len(of_study), 1.0 / len(of_study) / len(moduli)) for of_study in moduli])
        each = ((weights @ m, np.sqrt(weights @ c @ weights)) for m, c in self.model.moduli_of(studies, stretches))
        return float(np.mean([ndtr((level - mean) / spread) for mean, spread in each]))


def candidates() -> tuple[Candidate, ...]:
    """All that are compared, the paper's first."""
    modulus = float(np.exp(CENTRE))
    neo_hookean = "neo-Hookean mean"
    return (
        CoregionalisedCandidate("coregionalised (the paper's)"),
        CoregionalisedCandidate("coregionalised, Matern 1/2", "matern12"),
        CoregionalisedCandidate("coregionalised, Matern 5/2", "matern52"),
        CoregionalisedCandidate("coregionalised, squared exponential", "squared-exponential"),
        CoregionalisedCandidate(f"coregionalised, {neo_hookean}", mean_modulus=modulus),
        CoregionalisedCandidate("one process a group", separate=True),
        CoregionalisedCandidate(f"one process a group, {neo_hookean}", mean_modulus=modulus, separate=True),
        HierarchicalCandidate(DEFAULT),
        HierarchicalCandidate("hierarchical, Matern 3/2", "matern32"),
        HierarchicalCandidate("hierarchical, squared exponential", "squared-exponential"),
        HierarchicalCandidate("hierarchical, papers not told apart", without=OF_PAPERS),
        HierarchicalCandidate("hierarchical, moduli only", without=OF_CURVES, mean_asymmetry=(0.0, 0.0)),
        HierarchicalCandidate("hierarchical, no mean asymmetry", mean_asymmetry=(0.0, 0.0)),
        HierarchicalCandidate("hierarchical, best hierarchy alone", sample=0),
    )


def _normal(error: Floats, spread: Floats) -> Floats:
    return -0.5 * (error / spread) ** 2 - np.log(spread) - 0.5 * np.log(2.0 * np.pi)
