"""Mechanisms of the registry that mean something in a specimen, as they propose themselves."""

from __future__ import annotations

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.cases.case import Case
from warpbrain.inference.causes import Kind
from warpbrain.physics.mechanism import Mechanism
from warpbrain.physics.mechanisms import mechanisms
from warpbrain.physics.proposal import NotTestableError, Proposal, Situation, Tests
from warpbrain.simulation.history import corners_of
from warpbrain.worlds.specimen.actions import Action, Effect, Variant
from warpbrain.worlds.specimen.material import can_act
from warpbrain.worlds.specimen.protocol import Protocol, Test

#: Rates that differ less than this are one rate, relative; a share of the duration at rest that counts as a hold.
_RATES, _HOLD = 1.5, 0.1
#: Modes of which the sign of the strain means something to a law that does not know volume.
_PULLED = ("axial", "biaxial")


def effects(case: Case, protocol: Protocol) -> tuple[dict[str, Effect], dict[str, str]]:
    """Mechanisms by name, and why others are not looked for."""
    tests = [protocol.tests[k] for k in protocol.to_fit]
    # of the tissue's own change of shape: to be pulled along two axes is to be pressed along the third
    sides = [(test.strain - 1.0) * (1.0 if test.mode == "axial" else -1.0) for test in tests if test.mode in _PULLED]
    shown = Tests(
        frozenset(test.mode for test in tests),
        len({(test.mode, np.round(test.turn, 6).tobytes()) for test in tests}),
        any(side.max() > 0.01 for side in sides),
        any(side.min() < -0.01 for side in sides),
    )
    situation = _situation(case, 2 if tells_time(protocol) else 1)
    found: dict[str, Effect] = {}
    rejected: dict[str, str] = {}
    for name, known in mechanisms().items():
        if not known.of_specimens:
            continue
        try:
            if not can_act(known):
                raise NotTestableError("acts before anything is imposed, and the zero of the force hides it")
            known.check_tests(shown)
            found[name] = _effect(known, known.proposals(situation))
        except NotTestableError as error:
            rejected[name] = f"not testable with these data: {error}"
    return found, rejected


def tells_time(protocol: Protocol) -> bool:
    """Whether tests show what time does: a hold, a way back, or two rates of one mode."""
    rates: dict[str, list[float]] = {}
    for test in protocol.tests:
        if not test.fitted or test.time is None:
            continue
        if _turns(test):
            return True
        rates.setdefault(test.mode, []).append(float(test.strain_path[-1] * test.reach / max(np.ptp(test.time), 1e-12)))
    return any(max(of_mode) > _RATES * min(of_mode) for of_mode in rates.values())


def _turns(test: Test) -> bool:
    assert test.time is not None
    corners = corners_of(test.time, test.strain, 0.05 * test.reach)
    slopes = np.diff(test.strain[corners])
    still = np.diff(test.time[corners])[np.abs(slopes) < 0.02 * test.reach].sum()
    back = (slopes > 0.1 * test.reach).any() and (slopes < -0.1 * test.reach).any()
    return bool(back or still > _HOLD * np.ptp(test.time))


def _situation(case: Case, instants: int) -> Situation:
    none, axes = np.zeros((0, 3)), ("along x", "along y", "along z")
    assumed = frozenset(mechanism.kind for mechanism in case.mechanisms)
    laws = frozenset(tissue.model for tissue in case.tissues.values())
    return Situation(
        case.mesh, case.gravity_axis, case.density, case.poisson, assumed, laws, (), (), instants, none, none, 0.0, axes
    )


def _effect(kind: type[Mechanism], proposals: object) -> Effect:
    assert isinstance(proposals, list | tuple)
    says = kind.parameters()
    numbers = [name for name, one in says.items() if one.kind in ("number", "numbers")]
    first: Proposal = proposals[0]
    here, there = (first.make(first.without + move) for move in (0.5 * first.sd, first.sd))
    varying = [name for name in numbers if _number(here, name) != _number(there, name)]
    return Effect(
        name=kind.kind,
        kind=Kind.PHYSICS,
        sentence=kind.sentence,
        names=tuple(varying),
        units=tuple(says[name].unit for name in varying),
        variants=tuple(_variant(proposal, varying) for proposal in proposals),
        runs=True,
    )


def _variant(proposal: Proposal, names: list[str]) -> Variant:
    """A proposal; it is tried where its first coefficient, its size, is one standard deviation away."""
    nothing = proposal.without
    move = np.zeros(len(proposal))
    move[0] = proposal.sd[0]
    # a size of one sign is proposed with where it is one, or is known by being cut off
    both = proposal.make(nothing - move), proposal.make(nothing)
    one_sign = _same(*both)
    signs = (1.0,) if one_sign else (1.0, -1.0)
    return Variant(
        act=lambda c, rows: Action(mechanisms=(proposal.make(c),)),
        mean=proposal.mean,
        sd=proposal.sd,
        nothing=nothing,
        trials=tuple((nothing + sign * move)[None] for sign in signs),
        values=lambda c: tuple(_number(proposal.make(c), name) for name in names),
        one_sign=one_sign,
        region="" if proposal.region == "all tissue" else proposal.region,
    )


def _same(one: Mechanism, other: Mechanism) -> bool:
    return repr(one) == repr(other)


def _number(mechanism: Mechanism, name: str) -> float:
    """A parameter as one number: of several the sum where that means something, otherwise the first."""
    says = mechanism.parameters()[name]
    values: Floats = np.ravel(getattr(mechanism, name))
    return float(values.sum() if says.adds_up else values[0]) / says.si
