"""What is looked for in the tests of a specimen: mechanisms of the registry, and what is no mechanism of `run`."""

from __future__ import annotations

from collections.abc import Sequence

from warpbrain.cases.case import Case
from warpbrain.diagnosis.specimen.acting import Assumption
from warpbrain.diagnosis.specimen.candidates import drift, friction, law_shape, registered, softening, unlike
from warpbrain.diagnosis.specimen.protocol import Protocol
from warpbrain.errors import InputError
from warpbrain.physics.proposal import NotTestableError

#: Those that are no mechanism of `run`, by kind.
OWN = {
    softening.KIND: softening.assumptions,
    law_shape.STIFFENING: law_shape.stiffening,
    law_shape.SECOND_INVARIANT: law_shape.second_invariant,
    friction.KIND: friction.assumptions,
    drift.KIND: drift.assumptions,
    unlike.KIND: unlike.assumptions,
}


def candidates_of(
    case: Case, protocol: Protocol, wanted: Sequence[str] | None = None
) -> tuple[dict[str, tuple[Assumption, ...]], dict[str, str]]:
    """Ways to act by kind, and why other kinds are not tried.

    Parameters
    ----------
    case : Case
    protocol : Protocol
    wanted : sequence of str, optional
        Kinds; all if absent.

    Raises
    ------
    InputError
        If a kind is wanted that nobody knows.
    """
    found, rejected = registered.assumptions(case, protocol)
    for kind, make in OWN.items():
        try:
            found[kind] = make(case, protocol)
        except NotTestableError as error:
            rejected[kind] = f"not testable with these data: {error}"
    if wanted is not None:
        for kind in wanted:
            if kind not in found and kind not in rejected:
                known = ", ".join((*found, *rejected))
                raise InputError(f"--candidates {kind}: means nothing in a specimen; what can be looked for: {known}")
        rejected |= {kind: "not asked for" for kind in (*found, *rejected) if kind not in wanted}
        found = {kind: ways for kind, ways in found.items() if kind in wanted}
    return found, rejected
