"""Mechanisms of the registry that mean something in a specimen, as they propose themselves."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from warpbrain.cases.case import Case
from warpbrain.diagnosis.specimen.acting import Acting, Assumption, Unit
from warpbrain.diagnosis.specimen.material import can_act
from warpbrain.diagnosis.specimen.protocol import Protocol, Test
from warpbrain.physics.mechanism import Mechanism
from warpbrain.physics.mechanisms import mechanisms
from warpbrain.physics.mechanisms.asymmetry import Asymmetry
from warpbrain.physics.mechanisms.compressibility import Compressibility
from warpbrain.physics.mechanisms.fibres import Fibres
from warpbrain.physics.mechanisms.viscoelasticity import Viscoelasticity
from warpbrain.physics.proposal import NotTestableError, Proposal
from warpbrain.simulation.history import corners_of
from warpbrain.worlds.body.dictionary import situation_of

Floats = NDArray[np.float64]

#: Rates that differ less than this are one rate, relative; a share of the duration at rest that counts as a hold.
_RATES, _HOLD = 1.5, 0.1
#: Standard deviations from which fits of several coefficients begin.
_STARTS = ((0.0,), (-1.0,), (1.0,))


def assumptions(case: Case, protocol: Protocol) -> tuple[dict[str, tuple[Assumption, ...]], dict[str, str]]:
    """Ways to act by kind, and why other kinds are not tried."""
    timed = tells_time(protocol)
    situation = situation_of(case, instants=2 if timed else 1)
    found: dict[str, tuple[Assumption, ...]] = {}
    rejected: dict[str, str] = {}
    for kind, known in mechanisms().items():
        if not known.of_specimens:
            continue
        try:
            _require_testable(known, case, protocol)
            proposals = _branches() if known is Viscoelasticity else known.proposals(situation)
            # ways that differ are beginnings enough
            starts = _STARTS if len(proposals) == 1 else _STARTS[:1]
            found[kind] = tuple(_assumption(known, proposal, starts) for proposal in proposals)
        except NotTestableError as error:
            rejected[kind] = f"not testable with these data: {error}"
    return found, rejected


def _branches() -> list[Proposal]:
    """One branch, at short, middle and long times of relaxation; its coefficients are `ln beta` and `ln tau`.

    Not what the mechanism proposes itself: tests in time tell its own time of relaxation, and it is fitted.
    """
    says = Viscoelasticity.parameters()
    modulus, relaxation = says["moduli"].expectation, says["times"].expectation
    assert modulus is not None and relaxation is not None
    sd = 0.5 * math.log(modulus.quantile(0.841) / modulus.quantile(0.159))
    apart = math.log(relaxation.quantile(0.5) / relaxation.quantile(1.0 / 6.0))
    return [
        Proposal(
            make=lambda c: Viscoelasticity(moduli=(math.exp(c[0]),), times=(math.exp(c[1]),)),
            mean=np.array([math.log(modulus.quantile(0.5)), math.log(relaxation.quantile(part))]),
            sd=np.array([sd, 0.5 * apart]),
            follows="smooth",
            region=f"relaxing in about {relaxation.quantile(part):.2g} s",
        )
        for part in (1.0 / 6.0, 0.5, 5.0 / 6.0)
    ]


def tells_time(protocol: Protocol) -> bool:
    """Whether tests show what time does: a hold, a way back, or two rates of one mode."""
    rates: dict[str, list[float]] = {}
    for test in protocol.tests:
        if not test.fitted or test.time is None:
            continue
        if _turns(test):
            return True
        rates.setdefault(test.mode, []).append(_rate(test))
    return any(max(of_mode) > _RATES * min(of_mode) for of_mode in rates.values())


def _turns(test: Test) -> bool:
    assert test.time is not None
    reach = max(float(np.abs(test.strain - test.rest).max()), 1e-12)
    corners = corners_of(test.time, test.strain, 0.05 * reach)
    slopes = np.diff(test.strain[corners])
    still = np.diff(test.time[corners])[np.abs(slopes) < 0.02 * reach].sum()
    return bool((slopes > 0.1 * reach).any() and (slopes < -0.1 * reach).any()) or bool(
        still > _HOLD * np.ptp(test.time)
    )


def _rate(test: Test) -> float:
    assert test.time is not None
    return float(np.abs(np.diff(test.strain)).sum() / max(float(np.ptp(test.time)), 1e-12))


def _require_testable(kind: type[Mechanism], case: Case, protocol: Protocol) -> None:
    """Raise `NotTestableError` if what a mechanism needs was not done."""
    fitted = [test for test in protocol.tests if test.fitted]
    modes = {test.mode for test in fitted}
    tension = any(test.mode == "axial" and test.strain.max() > 1.01 for test in fitted)
    compression = any(test.mode == "axial" and test.strain.min() < 0.99 for test in fitted)
    if kind is Compressibility:
        raise NotTestableError("needs the lateral stretch or the volume to be recorded")
    if not can_act(kind):
        raise NotTestableError("acts before anything is imposed, and the zero of the force hides it")
    if kind is Asymmetry and not ((tension and compression) or ("shear" in modes and (tension or compression))):
        raise NotTestableError(f"needs {' and '.join(kind.needs)}")
    if kind is Fibres and len(modes) < 2:
        raise NotTestableError(f"needs {' and '.join(kind.needs)}")
    if kind is Viscoelasticity and not tells_time(protocol):
        raise NotTestableError(f"needs {' and '.join(kind.needs)}: a hold, a way back or another rate, with times")
    if any(mechanism.kind == kind.kind for mechanism in case.mechanisms) and not kind.several:
        raise NotTestableError("the case assumes it already")


def _assumption(kind: type[Mechanism], proposal: Proposal, starts: tuple[tuple[float, ...], ...]) -> Assumption:
    def act(c: Floats, unit: Unit) -> Acting:
        return Acting(mechanisms=(proposal.make(c),))

    shown = [name for name, says in kind.parameters().items() if says.kind in ("number", "numbers")]
    example = proposal.make(proposal.mean + 0.1 * proposal.sd)
    varying = [name for name in shown if _number(example, name) != _number(proposal.make(proposal.mean), name)]
    return Assumption(
        kind=kind.kind,
        physics=True,
        sentence=kind.sentence,
        names=tuple(varying),
        units=tuple(kind.parameters()[name].unit for name in varying),
        mean=proposal.mean,
        sd=proposal.sd,
        act=act,
        values=lambda c: tuple(_number(proposal.make(c), name) for name in varying),
        runs=True,
        region="" if proposal.region == "all tissue" else proposal.region,
        starts=starts,
    )


def _number(mechanism: Mechanism, name: str) -> float:
    """A parameter as one number: the first of a list."""
    says = mechanism.parameters()[name]
    values: Sequence[float] = np.ravel(getattr(mechanism, name)).tolist()
    return float(values[0]) / says.si
