"""What a diagnosis of a specimen found, as typed objects that the report is written from, and its sentences."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.cases.specimen import REST
from warpbrain.inference.beliefs import belief
from warpbrain.inference.calibration import percent
from warpbrain.inference.decide import UNKNOWN
from warpbrain.inference.gaussian import GaussianModel
from warpbrain.physics.sizes import size_in_words
from warpbrain.physics.words import Measurement, Smallest, Value, pascals
from warpbrain.simulation.specimen import specimen_of
from warpbrain.worlds.specimen.fit import CANNOT_BE, Fit
from warpbrain.worlds.specimen.glued_ends import ELEMENTS
from warpbrain.worlds.specimen.protocol import Protocol, Test, noise_factor
from warpbrain.worlds.specimen.search import Linear
from warpbrain.worlds.verdict import Ranked, Verdict, Words, clause, grounds, verdict_in_words

#: Of a cause no more numbers are said in a sentence.
_VALUES = 6
#: Movement between rows, over the largest strain, below which a test rests; step of differences.
_STILL, _STEP = 0.002, 1e-3
#: Rows of a side of a further test, largest strain of one, duration [s] where no test has times, and part of a modulus
#: that differs from specimen to specimen and tells nothing.
_ROWS, _REACH, _DURATION, _SPREAD = 40, 0.5, 100.0, 0.1


@dataclass(frozen=True)
class Segment:
    """Where in the tests a cause shows most: "loading", "unloading" or "hold", from strain to strain, time to time."""

    test: str
    mode: str
    segment: str
    strain: tuple[float, float]
    time: tuple[float, float] | None


@dataclass(frozen=True)
class Score:
    """Root mean square errors over all recorded rows [Pa]: of tests that were fitted, of these held out in turn (None
    where nothing was fitted at all), and of each test with role `check`."""

    fitted: float
    heldout: float | None
    check: dict[str, float]


@dataclass(frozen=True, kw_only=True, eq=False)
class SpecimenDiagnosis(Verdict):
    """A diagnosis of a specimen; what it has in common with others: `warpbrain.worlds.verdict.Verdict`.

    Attributes
    ----------
    protocol : Protocol
        All recorded rows.
    where : Segment or None
    scores : dict of str to Score
        ``"declared"``, ``"refitted"`` and, if something is missing, ``"explained"``.
    stresses : dict of str to (n,) array
        Of the same, at all rows [Pa]; and ``"heldout refitted"``, ``"heldout explained"``.
    improvement : (part, low, high) or None
        Of the refitted case's held-out error that is gone.
    """

    protocol: Protocol
    where: Segment | None
    scores: Mapping[str, Score]
    stresses: Mapping[str, Floats]
    improvement: tuple[float, float, float] | None

    @property
    def by_test(self) -> bool:
        """Whether whole tests were held out, not quarters of the only one."""
        return self.protocol.by_test

    @cached_property
    def sentence(self) -> str:
        """The verdict for people."""
        named, causes, scores = self.named, self.decision.causes, self.scores
        members = [cause for cause in self.ranking if cause.kind in causes and cause.kind != UNKNOWN]
        heldout = [pascals(scores[name].heldout or 0.0) for name in ("explained", "refitted") if name in scores]
        words = Words(
            data="these tests",
            nothing="none of those that were looked for",
            unnamed="a smooth change of single tests",
            named=[specimen_effect_sentence(cause) for cause in named],
            grounds=grounds([cause.probability for cause in named], "tests", (heldout[0], heldout[-1])),
            members=[(cause.sentence, cause.probability) for cause in members],
            perhaps=[f"{clause(cause.sentence)} ({percent(cause.probability)})" for cause in members],
        )
        return verdict_in_words(self, words)


def specimen_effect_sentence(cause: Ranked) -> str:
    """What a cause is, how large it was found to be, and in which way it acts."""
    size = "; ".join([*size_in_words(cause.kind, cause.values)[:_VALUES], *([cause.region] if cause.region else [])])
    return f"{cause.sentence.rstrip('.')}: {size}." if size else cause.sentence


def assumptions_of(fit: Fit, protocol: Protocol) -> tuple[str, ...]:
    """What was taken for granted."""
    case, glued = fit.forward.case, fit.forward.factor
    remembering = any(len(chain.tests) > 1 for chain in protocol.chains)
    if np.any(glued != 1.0):
        ends = (
            f"Stress is that of the homogeneous state times {glued.min():.3g} to {glued.max():.3g}, the factor of "
            f"glued ends: finite elements ({ELEMENTS}) of the law that was arrived at, elastic; memory is taken "
            "to have the same factor."
        )
    elif specimen_of(case).grips == "glued":
        ends = "The state is taken for homogeneous, though the ends are glued."
    else:
        ends = "Ends slide without friction: the state is homogeneous."
    return (
        *case.assumptions,
        f"Errors are of all {len(protocol)} recorded rows of {len(protocol.tests)} tests, as nominal stress; "
        f"probabilities are of {len(protocol.thinned)} of them.",
        *(["Tests whose times go on are one history: tissue remembers the earlier ones."] if remembering else []),
        f"The noise of a test is {100 * belief('specimen.reading'):g} % of its largest stress or its roughness, and "
        f"{100 * belief('specimen.shared'):g} % that a stretch of the curve has in common, times {fit.scale:.2f}, as "
        "was found.",
        ends,
        f"Allowed to explain differences first: {', '.join(fit.forward.names)}.",
        "Held out: each test in turn." if protocol.by_test else "Held out: each quarter of the only test in turn.",
    )


def values_of(fit: Fit, name: str) -> tuple[Value, ...]:
    """Parameters of one of the causes of a fit, with standard deviations to first order."""
    number = [cause.effect.name for cause in fit.assumed].index(name)
    component, part = fit.assumed[number], fit.part(number)
    if not component.effect.names:
        return ()
    z = fit.z[part]
    here = np.array(component.variant.values(component.coefficients(z)))
    moved = [np.array(component.variant.values(component.coefficients(z + _STEP * move))) for move in np.eye(len(z))]
    slope = (np.array(moved) - here).T / _STEP
    sd = np.sqrt(np.maximum(np.diag(slope @ fit.covariance[part, part] @ slope.T), 0.0))
    each = zip(component.effect.names, here.tolist(), sd.tolist(), component.effect.units, strict=True)
    return tuple(Value(*value) for value in each)


def where_it_shows(protocol: Protocol, without: Floats, with_it: Floats) -> Segment:
    """The segment in which squared errors of stresses (n,), over the largest of the test, fall most [Pa]."""
    segments = []
    for number in protocol.to_fit:
        test, rows = protocol.tests[number], protocol.rows[number]
        gain = ((test.stress - without[rows]) ** 2 - (test.stress - with_it[rows]) ** 2) / test.peak**2
        moves = np.gradient(np.abs(test.strain - test.rest)) / test.reach
        names = np.where(np.abs(moves) < _STILL, "hold", np.where(moves > 0.0, "loading", "unloading"))
        for name in dict.fromkeys(names.tolist()):
            for side in (test.strain >= test.rest, test.strain < test.rest):
                part = (names == name) & side
                if part.any():
                    strain, time = test.strain[part], None if test.time is None else test.time[part]
                    times = None if time is None else (float(time.min()), float(time.max()))
                    strains = float(strain.min()), float(strain.max())
                    segments.append((float(gain[part].sum()), Segment(test.name, test.mode, name, strains, times)))
    return max(segments, key=lambda gained: gained[0])[1]


def smallest_of(about: Linear) -> dict[str, Smallest]:
    """Of each cause, the size of its first number that is seen nearly always; of its places the plainest counts."""
    smallest: dict[str, Smallest] = {}
    for cause, components in zip(about.causes, about.components, strict=True):
        effect = components[0].effect
        if not effect.names:
            continue
        seen = [float(np.linalg.norm(about.fit.model.standardised(place.columns[:, :1]))) for place in cause.places]
        best = int(np.argmax(seen))
        variant, trial = components[best].variant, components[best].trial
        part = belief("specimen.seen") / max(seen[best], 1e-12)
        there = variant.nothing + part * (trial[0] - variant.nothing)
        size = abs(variant.values(there)[0] - variant.values(variant.nothing)[0])
        plausible = part <= belief("checks.farthest")
        smallest[effect.name] = Smallest(size, effect.units[0], effect.names[0], plausible=plausible)
    return smallest


def next_measurements(likeliest: Fit, other: Fit) -> tuple[Measurement, ...]:
    """What could be measured to tell the materials of two fits apart, what tells most first: expected Bayes factors."""
    tests = likeliest.forward.protocol.tests
    reach = min(max(test.reach for test in tests), _REACH)
    lasts = [float(np.ptp(test.time)) for test in tests if test.time is not None]
    measurements = []
    for words, (mode, strain, time) in _tests(reach, max(lasts, default=_DURATION)).items():
        try:
            first, second = (
                fit.forward.modulus(fit.z) * fit.forward.material(fit.assumed, fit.z).stress(mode, strain, time)
                for fit in (likeliest, other)
            )
        except CANNOT_BE:
            continue
        away = float(np.abs(strain - REST[mode]).max())
        path = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(strain)))]) / away
        test = Test(
            words, mode, "", True, np.arange(len(strain)), strain, first, time, path, 0.0, 1.0,
            float(np.abs(first).max()), away, np.eye(3),
        )  # fmt: skip
        model = GaussianModel(noise_factor(Protocol((test,))), _SPREAD * second[:, None])
        measurements.append(Measurement(words, 0.5 * float(np.sum(model.standardised(first - second) ** 2))))
    return tuple(sorted(measurements, key=lambda measurement: -measurement.expected_nats))


def _tests(reach: float, duration: float) -> dict[str, tuple[str, Floats, Floats]]:
    """Mode, strain and time of what could be done, as far and about as long as what was done."""
    up = np.linspace(0.0, 1.0, _ROWS)
    cycle = np.concatenate([up, up[::-1][1:], -up[1:], -up[::-1][1:]])
    ramp = np.concatenate([np.linspace(0.0, 1.0, 8), np.ones(_ROWS)])
    rest = np.concatenate([np.linspace(0.0, 0.02, 8), 0.02 + np.geomspace(0.005, 1.0, _ROWS)])
    share = np.linspace(0.0, 1.0, len(cycle))
    return {
        "tension, slowly": ("axial", 1.0 + reach * up, duration * up),
        "compression, slowly": ("axial", 1.0 - reach * up, duration * up),
        "simple shear, slowly": ("shear", reach * up, duration * up),
        "torsion, slowly": ("torsion", reach * up, duration * up),
        "a compression that is held": ("axial", 1.0 - reach * ramp, duration * rest),
        "a shear that is held": ("shear", reach * ramp, duration * rest),
        "a cycle of tension and compression": ("axial", 1.0 + reach * cycle, duration * share),
        "the same cycle ten times as fast": ("axial", 1.0 + reach * cycle, 0.1 * duration * share),
        "half as much again of compression": ("axial", 1.0 - 1.5 * reach * up, duration * up),
    }
