"""What is looked for in the tests of a specimen: mechanisms of the registry, and what is no mechanism of `run`."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from warpbrain.cases.case import Case
from warpbrain.errors import InputError
from warpbrain.physics.proposal import NotTestableError
from warpbrain.worlds.specimen.actions import Effect
from warpbrain.worlds.specimen.effects import law_shape, not_physics, registered, softening
from warpbrain.worlds.specimen.protocol import Protocol

_MAKERS: dict[str, Callable[[Case, Protocol], Effect]] = {
    softening.NAME: softening.softening,
    law_shape.STIFFENING: law_shape.stiffening,
    law_shape.SECOND_INVARIANT: law_shape.second_invariant,
    not_physics.FRICTION: not_physics.friction,
    not_physics.DRIFT: not_physics.drift,
    not_physics.UNLIKE: not_physics.unlike,
}


def effects_of(
    case: Case, protocol: Protocol, wanted: Sequence[str] | None = None
) -> tuple[tuple[Effect, ...], dict[str, str]]:
    """Causes that are looked for, and why others are not.

    Parameters
    ----------
    case : Case
    protocol : Protocol
    wanted : sequence of str, optional
        Names; all if absent.

    Raises
    ------
    InputError
        If one is wanted that nobody knows.
    """
    found, rejected = registered.effects(case, protocol)
    for name, make in _MAKERS.items():
        try:
            found[name] = make(case, protocol)
        except NotTestableError as error:
            rejected[name] = f"not testable with these data: {error}"
    if wanted is not None:
        for name in wanted:
            if name not in found and name not in rejected:
                known = ", ".join((*found, *rejected))
                raise InputError(f"--candidates {name}: means nothing in a specimen; what can be looked for: {known}")
        rejected |= {name: "not asked for" for name in (*found, *rejected) if name not in wanted}
        found = {name: effect for name, effect in found.items() if name in wanted}
    return tuple(found.values()), rejected
