"""Which causes are looked for in a specimen: mechanisms of the registry, as they propose themselves, and all others."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.cases.case import Case
from warpbrain.errors import InputError
from warpbrain.inference.causes import Kind
from warpbrain.physics.mechanism import Mechanism
from warpbrain.physics.mechanisms import mechanisms
from warpbrain.physics.proposal import NotTestableError, Proposal, Situation, Tests
from warpbrain.simulation.history import corners_of
from warpbrain.worlds.specimen import effects
from warpbrain.worlds.specimen.effects import Action, Effect, Variant
from warpbrain.worlds.specimen.material import can_act
from warpbrain.worlds.specimen.protocol import Protocol, Test

#: Rates that differ less than this are one rate, relative; a share of the duration at rest that counts as a hold.
_RATES, _HOLD = 1.5, 0.1
#: Modes of which the sign of the strain means something to a law that does not know volume.
_PULLED = ("axial", "biaxial")
#: Causes that are no mechanism of a run.
_OTHERS = {
    "softening": effects.softening,
    "stiffening": effects.stiffening,
    "second invariant": effects.second_invariant,
    "end friction": effects.friction,
    "drift of the zero": effects.drift,
    "unlike specimens": effects.unlike,
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
    registry = {name: known for name, known in mechanisms().items() if known.of_specimens}
    for name in (*registry, *_OTHERS):
        try:
            if name in registry:
                testable[name] = _registered(registry[name], shown, situation)
            else:
                testable[name] = _OTHERS[name](case, protocol)
        except NotTestableError as error:
            rejected[name] = f"not testable with these data: {error}"
    if wanted is not None:
        for name in wanted:
            if name not in testable and name not in rejected:
                known = ", ".join((*testable, *rejected))
                raise InputError(f"--candidates {name}: means nothing in a specimen; what can be looked for: {known}")
        rejected |= {name: "not asked for" for name in (*testable, *rejected) if name not in wanted}
        testable = {name: effect for name, effect in testable.items() if name in wanted}
    return (*testable.values(), effects.unknown(protocol)), rejected


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
        case.mesh,
        case.gravity_axis,
        case.density,
        case.poisson,
        assumed,
        laws,
        (),
        (),
        instants,
        none,
        none,
        0.0,
        axes=axes,
    )


def _registered(kind: type[Mechanism], shown: Tests, situation: Situation) -> Effect:
    if not can_act(kind):
        raise NotTestableError("acts before anything is imposed, and the zero of the force hides it")
    kind.check_tests(shown)
    proposals = kind.proposals(situation)
    says, first = kind.parameters(), proposals[0]
    here, there = (first.make(first.without + move) for move in (0.5 * first.sd, first.sd))
    numbers = [name for name, parameter in says.items() if parameter.kind in ("number", "numbers")]
    names = tuple(name for name in numbers if _number(here, name) != _number(there, name))
    variants = tuple(_variant(proposal, names) for proposal in proposals)
    return Effect(
        kind.kind, Kind.PHYSICS, kind.sentence, variants, names, tuple(says[name].unit for name in names), True
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
    says = mechanism.parameters()[name]
    values: Floats = np.ravel(getattr(mechanism, name))
    return float(values.sum() if says.adds_up else values[0]) / says.si
