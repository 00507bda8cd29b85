"""Screening of a case: its sets of causes, weighed in the linear model about its base."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from typing import Any

from warpbrain.cases.case import Case
from warpbrain.cases.enough import too_few_to_diagnose
from warpbrain.errors import InputError
from warpbrain.estimation.observations import Observations
from warpbrain.estimation.options import Listener
from warpbrain.estimation.parameters import Gaussian
from warpbrain.threads import one_thread_of_blas
from warpbrain.worlds.body.base import BaseFinder
from warpbrain.worlds.body.dictionary import candidates_at, dictionary_of
from warpbrain.worlds.body.hypotheses import HypothesisSearch
from warpbrain.worlds.body.not_physics import not_physics_at
from warpbrain.worlds.body.states import States, instants_of


def require_observable(case: Case) -> None:
    """Raise `InputError` if there are too few recordings."""
    if case.specimen is not None:
        raise InputError(f"{case.path}: [specimen]: a specimen is diagnosed test by test")
    Observations.to_fit(case)
    if why := too_few_to_diagnose(case):
        raise InputError(f"{case.path}: {why}")


def screened(
    case: Case,
    device: str | None = None,
    listener: Listener | None = None,
    prior: Gaussian | None = None,
    *,
    mesh_error: bool = True,
    without_nuisances: bool = False,
    mechanisms: Sequence[str] | None = None,
    timed: Callable[[str], AbstractContextManager[Any]] = nullcontext,
) -> HypothesisSearch:
    """Sets of causes of a case.

    Parameters
    ----------
    case : Case
    device : str, optional
        Warp device.
    listener : Listener, optional
    prior : Gaussian, optional
        Of the tissues' parameters; that of a diagnosis unless given.
    mesh_error : bool
        False: the mesh is taken for exact.
    without_nuisances : bool
        Whether mechanisms are credited with what is no physics, too.
    mechanisms : sequence of str, optional
        Kinds that are looked for; all by default.
    timed : callable, optional
        A context in which each stage is done, by its name.

    Raises
    ------
    InputError
        If there are too few recordings.
    SolveError
        If the case as declared has no equilibrium.
    """
    require_observable(case)
    listener = listener or Listener()
    states = States(case, device)
    dictionary = dictionary_of(case, mechanisms, instants_of(case, states.times), states.times)
    spacing = dictionary.situation.spacing
    with one_thread_of_blas():
        with timed("base"):
            base = BaseFinder(states, spacing, mesh_error, without_nuisances, listener, prior).find()
        with timed("candidates"):
            candidates = candidates_at(
                dictionary,
                base.effects,
                not_physics_at(base.at, base.nuisances),
                lambda kind: listener.stage(f"candidate: {kind}"),
            )
        search = HypothesisSearch(base, candidates, spacing, listener)
        with timed("screening"):
            search.screen()
    return search
