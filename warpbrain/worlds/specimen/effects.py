"""What a cause does to the tests of a specimen, in one shape for all; and the causes that are no mechanism of a run.

    softening           stress x (1 - D (1 - I/I_max))        I = I1 - 3, I_max the largest so far (Mullins 1948)
                        stress x (1 - D (1 - exp(-(s/w)^2)))  s, the strain path so far over the largest strain
    stiffening          stress x exp(k (I1 - 3))              (Demiray 1972), of all stress, what is remembered, too
    second invariant    mu ((1 - c) neo-Hookean + c of `I2`)  (Mooney 1940)
    end friction        a share of the way from lubricated ends to glued ones, or back
    drift of the zero   a parabola over the time of each chain of tests
    unlike specimens    a factor for each specimen
    unknown             any smooth change of single tests

Mechanisms of the registry act through the material, as they propose themselves. Small errors of the law, of ends, zeros
and specimens are nuisances of every hypothesis (`forward`); these are large.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.cases.case import Case
from warpbrain.errors import InputError
from warpbrain.inference.beliefs import belief, beliefs
from warpbrain.inference.causes import Kind
from warpbrain.inference.decide import UNKNOWN
from warpbrain.physics.mechanism import Mechanism
from warpbrain.physics.mechanisms import mechanisms
from warpbrain.physics.proposal import NotTestableError, Proposal, Situation, Tests
from warpbrain.physics.words import Value
from warpbrain.simulation.history import corners_of
from warpbrain.simulation.specimen import specimen_of
from warpbrain.worlds.specimen.material import can_act
from warpbrain.worlds.specimen.protocol import Chain, Protocol, Test, smooth_patterns

if TYPE_CHECKING:
    from warpbrain.worlds.specimen.fit import Forward

#: Strain path over the largest strain after which tissue was deformed before; beyond which no exponential is computed.
_BACK, _MOST = 1.2, 8.0
#: Rates that differ less than this are one rate, relative; a share of the duration at rest that counts as a hold.
_RATES, _HOLD = 1.5, 0.1
#: Modes of which the sign of the strain means something to a law that does not know volume.
_PULLED = ("axial", "biaxial")


@dataclass(frozen=True, eq=False)
class Action:
    """What a cause does: mechanisms of the registry, a factor (n,) on the stress, stress (n,) that is added [Pa].

    `scaled` is added before the stress is scaled by the modulus, `added` after that.
    """

    mechanisms: tuple[Mechanism, ...] = ()
    factor: Floats | float = 1.0
    scaled: Floats | float = 0.0
    added: Floats | float = 0.0


@dataclass(frozen=True, eq=False)
class Variant:
    """One of the ways in which a cause may act, with k coefficients."""

    #: From coefficients (k,) and the case without the cause to what it does.
    act: Callable[[Floats, Forward], Action]
    #: Of the coefficients (k,) at the largest size that is plausible, normal; and where they do nothing.
    mean: Floats
    sd: Floats
    nothing: Floats
    #: Coefficients (m, k) whose effects, less what nothing does, are the columns of a place: one array a place.
    trials: tuple[Floats, ...]
    #: From coefficients to the numbers that users know.
    values: Callable[[Floats], tuple[float, ...]]
    #: Whether only sizes of the sign of the trials do anything; in which way it acts, in words.
    one_sign: bool = False
    region: str = ""
    #: Of what only adds stress, from a protocol to the stress (n, k) of a unit of each coefficient.
    added: Callable[[Protocol], Floats] | None = None

    @classmethod
    def of(
        cls, act: Callable[[Floats, Forward], Action], sd: float, count: int = 1, signs: tuple[float, ...] = (1.0,),
        **particular: Any,
    ) -> Variant:  # fmt: skip
        """A variant with coefficients of one size that do nothing at 0 and are what users know, tried with signs."""
        zero, trials = np.zeros(count), tuple(sign * sd * np.eye(count) for sign in signs)
        return cls(act, zero, np.full(count, sd), zero, trials, lambda c: tuple(c.tolist()), **particular)

    @classmethod
    def of_added(cls, added: Callable[[Protocol], Floats], sd: float, count: int) -> Variant:
        """A variant that only adds stress."""
        return cls.of(lambda c, forward: Action(added=added(forward.protocol) @ c), sd, count, added=added)


@dataclass(frozen=True, eq=False)
class Effect:
    """A cause with all its variants.

    `names` and `units` are of what `Variant.values` says; `runs`, whether `warpbrain run` can simulate it; `by_sign`,
    its sentence where its number is negative, and where it is positive, if these differ.
    """

    name: str
    kind: Kind
    sentence: str
    variants: tuple[Variant, ...]
    names: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    runs: bool = False
    by_sign: tuple[str, str] | None = None

    def sentence_of(self, values: Sequence[Value]) -> str:
        """Its sentence, with values that were found or without any."""
        return self.by_sign[values[0].value > 0.0] if self.by_sign and values else self.sentence


def softening(case: Case, protocol: Protocol) -> Effect:
    """Tissue that is softer where it was deformed before: below the largest strain so far, or cycle by cycle."""
    if not any(_strain_path(protocol, chain)[-1] > _BACK for chain in protocol.chains):
        raise NotTestableError("needs a test that comes back or is repeated")

    def below(protocol: Protocol, chain: Chain) -> Floats:
        I = _first_invariant(protocol.tests[chain.tests[0]].mode, chain.strain)
        return 1.0 - I / np.maximum(np.maximum.accumulate(I), 1e-12)

    def cycles(protocol: Protocol, chain: Chain) -> Floats:
        return -np.expm1(-((_strain_path(protocol, chain) / belief("specimen.softening_way")) ** 2))

    def act(pattern: Callable[[Protocol, Chain], Floats], c: Floats, forward: Forward) -> Action:
        each = [pattern(forward.protocol, chain) for chain in forward.protocol.chains]
        return Action(factor=1.0 - np.clip(c[0], 0.0, 0.95) * np.concatenate(each))

    patterns = ((below, "below the largest strain so far"), (cycles, "with every cycle"))
    size = belief("specimen.largest_softening")
    variants = tuple(Variant.of(partial(act, each), size, one_sign=True, region=words) for each, words in patterns)
    return Effect(
        "softening", Kind.PHYSICS, "Tissue is softer where it was deformed before.", variants, ("part",), ("",)
    )


def _strain_path(protocol: Protocol, chain: Chain) -> Floats:
    """Strain path (n,) of a chain, over its largest strain."""
    tests = [protocol.tests[k] for k in chain.tests]
    ends = np.cumsum([0.0, *(test.strain_path[-1] * test.reach for test in tests)])
    each = [end + test.strain_path * test.reach for end, test in zip(ends, tests, strict=False)]
    return np.concatenate(each) / max(test.reach for test in tests)


def _first_invariant(mode: str, strain: Floats) -> Floats:
    """`I1 - 3` of incompressible states at stretches or shears (torsion: at the rim); confined: `J^(-2/3) I1 - 3`."""
    if mode == "confined":
        return strain ** (4.0 / 3.0) + 2.0 * strain ** (-2.0 / 3.0) - 3.0
    if mode == "biaxial":
        return 2.0 * strain**2 + strain**-4 - 3.0
    return strain**2 + 2.0 / strain - 3.0 if mode == "axial" else strain**2


def invariant_rows(protocol: Protocol) -> Floats:
    """`I1 - 3` (n,) at all rows."""
    return np.concatenate([_first_invariant(test.mode, test.strain) for test in protocol.tests])


def excess_rows(forward: Forward) -> Floats:
    """Stress (n,) of `I2` less that of `I1` [Pa] at one shear modulus; confined: of the changes of shape."""
    return forward.mu * np.concatenate([_excess(t.mode, t.strain) for t in forward.protocol.tests]) * forward.factor


def _excess(mode: str, l: Floats) -> Floats:
    """Slopes of `I2 / 2` less those of `I1 / 2`, along the machine's axis (biaxial: along one of two)."""
    if mode == "axial":
        return 1.0 - l**-3 - l + l**-2
    if mode == "biaxial":
        return l**3 - l**-3 - l + l**-5
    if mode == "confined":
        return 2.0 / 3.0 * (l ** (-1.0 / 3.0) - l ** (-7.0 / 3.0) - l ** (1.0 / 3.0) + l ** (-5.0 / 3.0))
    # in shear both invariants are one
    return np.zeros(len(l))


def stiffening(case: Case, protocol: Protocol) -> Effect:
    """A factor on the response; a negative `k` softens."""

    def act(c: Floats, forward: Forward) -> Action:
        return Action(factor=np.exp(np.clip(c[0] * invariant_rows(forward.protocol), -_MOST, _MOST)))

    size = belief("specimen.largest_stiffening") / float(invariant_rows(protocol).max())
    words = "Tissue stiffens with strain {} than its law says, in all directions alike, by a factor exp(k (I1 - 3))."
    sentence, less, more = (words.format(how) for how in ("more or less", "less", "more"))
    variants = (Variant.of(act, size, signs=(1.0, -1.0)),)
    return Effect("stiffening", Kind.PHYSICS, sentence, variants, ("k",), ("",), by_sign=(less, more))


def second_invariant(case: Case, protocol: Protocol) -> Effect:
    """A share of any size."""
    if not any(test.rest == 1.0 for test in protocol.tests if test.fitted):
        raise NotTestableError("needs an axial, confined or biaxial test: in shear both invariants are one")
    size = belief("specimen.largest_second_invariant")
    variants = (Variant.of(lambda c, forward: Action(scaled=c[0] * excess_rows(forward)), size, signs=(1.0, -1.0)),)
    sentence = "The law of the tissue depends on the second invariant."
    return Effect("second invariant", Kind.PHYSICS, sentence, variants, ("share",), ("",))


def friction(case: Case, protocol: Protocol) -> Effect:
    """A share of the way from one kind of ends to the other, of axial tests."""
    if not any(test.mode == "axial" for test in protocol.tests if test.fitted):
        raise NotTestableError("needs an axial test")
    glued = specimen_of(case).grips == "glued"

    def act(c: Floats, forward: Forward) -> Action:
        axial = forward.protocol.mask([k for k, test in enumerate(forward.protocol.tests) if test.mode == "axial"])
        part = float(np.clip(c[0], 0.0, 1.0))
        sticks, present = (1.0 - part, forward.factor) if glued else (part, 1.0)
        return Action(factor=np.where(axial, (1.0 + sticks * (forward.sticking - 1.0)) / present, 1.0))

    variants = (Variant.of(act, belief("specimen.largest_slip"), one_sign=True),)
    sentence = "The ends of the specimen slip." if glued else "The ends of the specimen stick to the platens."
    return Effect("end friction", Kind.NOT_PHYSICS, sentence, variants, ("share",), ("",))


def drift(case: Case, protocol: Protocol) -> Effect:
    """Of each chain a parabola over its time; of tests without times a constant."""
    names = tuple(
        f"{protocol.tests[chain.tests[0]].name}, {shape}"
        for chain in protocol.chains
        for shape in (("constant",) if chain.time is None else ("constant", "line", "parabola"))
    )

    def shapes(protocol: Protocol) -> Floats:
        columns = []
        for chain in protocol.chains:
            each = [np.ones(len(chain.strain))]
            if chain.time is not None:
                s = (chain.time - chain.time[0]) / max(float(np.ptp(chain.time)), 1e-12)
                each += [s, s * (1.0 - s)]
            of_chain = np.zeros((len(protocol), len(each)))
            of_chain[protocol.mask(chain.tests)] = np.column_stack(each)
            columns.append(max(protocol.tests[k].peak for k in chain.tests) * of_chain)
        return np.concatenate(columns, axis=1)

    variants = (Variant.of_added(shapes, belief("specimen.largest_drift"), len(names)),)
    units = ("of the largest stress",) * len(names)
    sentence = "The zero of the force drifts, or is wrong."
    return Effect("drift of the zero", Kind.NOT_PHYSICS, sentence, variants, names, units)


def unlike(case: Case, protocol: Protocol) -> Effect:
    """A factor of the stress of each specimen."""
    count = len(protocol.specimens)
    if count < 2:
        raise NotTestableError("needs tests of several specimens ([[recording]] specimen)")

    def act(c: Floats, forward: Forward) -> Action:
        return Action(factor=np.exp(specimen_rows(forward.protocol) @ c))

    variants = (Variant.of(act, belief("specimen.largest_unlike"), count),)
    names = tuple(f"ln stiffness of {name or 'the unnamed'}" for name in protocol.specimens)
    sentence = "The specimens are not of one stiffness."
    return Effect("unlike specimens", Kind.NOT_PHYSICS, sentence, variants, names, ("",) * count)


def specimen_rows(protocol: Protocol) -> Floats:
    """Which rows (n, specimens) are of which specimen, 0 or 1."""
    of_test = np.array([protocol.specimens.index(test.specimen) for test in protocol.tests])
    return (of_test[protocol.test_of, None] == np.arange(len(protocol.specimens))).astype(float)


def unknown(protocol: Protocol) -> Effect:
    """Smooth changes of single tests, at the rows of this protocol; what shows in no fitted row is left out."""
    variants = []
    for reach in beliefs("specimen.unknown_reaches"):
        columns = smooth_patterns(protocol, reach)
        columns = columns[:, np.any(columns[protocol.fitted] != 0.0, axis=0)]
        size = belief("specimen.largest_unknown")
        variants.append(Variant.of_added(partial(lambda fixed, _protocol: fixed, columns), size, columns.shape[1]))
    return Effect(UNKNOWN, Kind.UNKNOWN, "Something acts that is none of the known mechanisms.", tuple(variants))


#: Causes that are no mechanism of a run.
_OTHERS = {
    "softening": softening,
    "stiffening": stiffening,
    "second invariant": second_invariant,
    "end friction": friction,
    "drift of the zero": drift,
    "unlike specimens": unlike,
}


def effects_of(
    case: Case, protocol: Protocol, wanted: Sequence[str] | None = None
) -> tuple[tuple[Effect, ...], dict[str, str]]:
    """Causes that are looked for, the unknown last, and why others are not; all unless some are wanted by name.

    `InputError` if one is wanted that nobody knows.
    """
    shown, situation = _shown(protocol), _situation(case, 2 if _tells_time(protocol) else 1)
    testable: dict[str, Effect] = {}
    rejected: dict[str, str] = {}
    registry = {name: kind for name, kind in mechanisms().items() if kind.of_specimens}
    makers = {name: partial(_registered, kind, shown, situation) for name, kind in registry.items()}
    makers |= {name: partial(make, case, protocol) for name, make in _OTHERS.items()}
    for name, make in makers.items():
        try:
            testable[name] = make()
        except NotTestableError as error:
            rejected[name] = f"not testable with these data: {error}"
    if wanted is not None:
        for name in wanted:
            if name not in testable and name not in rejected:
                known = ", ".join((*testable, *rejected))
                raise InputError(f"--candidates {name}: means nothing in a specimen; what can be looked for: {known}")
        rejected |= {name: "not asked for" for name in (*testable, *rejected) if name not in wanted}
        testable = {name: effect for name, effect in testable.items() if name in wanted}
    return (*testable.values(), unknown(protocol)), rejected


def _shown(protocol: Protocol) -> Tests:
    tests = [test for test in protocol.tests if test.fitted]
    # of the tissue's own change of shape: to be pulled along two axes is to be pressed along the third
    sides = [(test.strain - 1.0) * (1.0 if test.mode == "axial" else -1.0) for test in tests if test.mode in _PULLED]
    return Tests(
        frozenset(test.mode for test in tests),
        len({(test.mode, np.round(test.turn, 6).tobytes()) for test in tests}),
        any(side.max() > 0.01 for side in sides),
        any(side.min() < -0.01 for side in sides),
    )


def _tells_time(protocol: Protocol) -> bool:
    """Whether tests show what time does: a hold, a way back, or two rates of one mode."""
    rates: dict[str, list[float]] = {}
    for test in protocol.tests:
        if not test.fitted or test.time is None:
            continue
        if _turns(test, test.time):
            return True
        rates.setdefault(test.mode, []).append(float(test.strain_path[-1] * test.reach / max(np.ptp(test.time), 1e-12)))
    return any(max(of_mode) > _RATES * min(of_mode) for of_mode in rates.values())


def _turns(test: Test, time: Floats) -> bool:
    corners = corners_of(time, test.strain, 0.05 * test.reach)
    slopes = np.diff(test.strain[corners])
    still = np.diff(time[corners])[np.abs(slopes) < 0.02 * test.reach].sum()
    back = (slopes > 0.1 * test.reach).any() and (slopes < -0.1 * test.reach).any()
    return bool(back or still > _HOLD * np.ptp(time))


def _situation(case: Case, instants: int) -> Situation:
    none, axes = np.zeros((0, 3)), ("along x", "along y", "along z")
    assumed = frozenset(mechanism.kind for mechanism in case.mechanisms)
    laws = frozenset(tissue.model for tissue in case.tissues.values())
    return Situation(
        case.mesh, case.gravity_axis, case.density, case.poisson, assumed, laws, held=(), free=(), instants=instants,
        volume_sites=none, surface_sites=none, spacing=0.0, axes=axes,
    )  # fmt: skip


def _registered(kind: type[Mechanism], shown: Tests, situation: Situation) -> Effect:
    if not can_act(kind):
        raise NotTestableError("acts before anything is imposed, and the zero of the force hides it")
    kind.check_tests(shown)
    proposals = kind.proposals(situation)
    specs, first = kind.parameters(), proposals[0]
    here, there = (first.make(first.without + move) for move in (0.5 * first.sd, first.sd))
    numbers = [name for name, parameter in specs.items() if parameter.kind in ("number", "numbers")]
    names = tuple(name for name in numbers if _number(here, name) != _number(there, name))
    variants = tuple(_variant(proposal, names) for proposal in proposals)
    return Effect(
        kind.kind, Kind.PHYSICS, kind.sentence, variants, names, tuple(specs[name].unit for name in names), True
    )


def _variant(proposal: Proposal, names: tuple[str, ...]) -> Variant:
    """A proposal; it is tried where its first coefficient, its size, is one standard deviation away."""
    nothing = proposal.without
    move = np.zeros(len(proposal))
    move[0] = proposal.sd[0]
    # a size of one sign is proposed with where it is one, or is known by being cut off
    one_sign = repr(proposal.make(nothing - move)) == repr(proposal.make(nothing))
    return Variant(
        act=lambda c, _: Action(mechanisms=(proposal.make(c),)),
        mean=proposal.mean,
        sd=proposal.sd,
        nothing=nothing,
        trials=tuple((nothing + sign * move)[None] for sign in ((1.0,) if one_sign else (1.0, -1.0))),
        values=lambda c: tuple(_number(proposal.make(c), name) for name in names),
        one_sign=one_sign,
        region="" if proposal.region == "all tissue" else proposal.region,
    )


def _number(mechanism: Mechanism, name: str) -> float:
    """A parameter as one number: of several the sum where that means something, otherwise the first."""
    spec = mechanism.parameters()[name]
    values: Floats = np.ravel(getattr(mechanism, name))
    return float(values.sum() if spec.adds_up else values[0]) / spec.si
