"""A case from what a user has to what is computed of it: what `warpbrain run` and `warpbrain.run` do."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from warpbrain.arrays import Floats
from warpbrain.cases.case import Case
from warpbrain.cases.shipped import as_case
from warpbrain.errors import InputError
from warpbrain.mesh import TetMesh
from warpbrain.recordings.recording import TestRecording
from warpbrain.shown import Shown
from warpbrain.simulation.courses import Course, Followed, Watching, follow, states_at_rest
from warpbrain.simulation.locking import choose_elements
from warpbrain.simulation.model import ELEMENTS, Model, require_held
from warpbrain.simulation.observation import Observed, observe
from warpbrain.simulation.of_case import model_of
from warpbrain.simulation.result import Result, nodal_state_of, result_of
from warpbrain.simulation.specimen import SpecimenRun, SpecimenRunning, not_transmitted, specimen_of
from warpbrain.simulation.system import System


@dataclass(frozen=True, eq=False)
class Run(Shown):
    """A simulated case.

    Attributes
    ----------
    case : Case
    model : Model
        Of the case, with the elements that were asked for or chosen.
    chosen : str or None
        Why these elements, if nobody asked for them.
    result : Result
        The last state.
    observed : Observed
        It, and earlier ones, beside what was recorded.
    followed : Followed
        How it was found.
    """

    case: Case
    model: Model
    chosen: str | None
    result: Result
    observed: Observed
    followed: Followed

    @property
    def mesh(self) -> TetMesh:
        """What is left of the anatomy, undeformed."""
        return self.result.mesh

    @property
    def u(self) -> Floats:
        """Displacement (n, 3) [m]."""
        return self.result.u

    @property
    def errors(self) -> Mapping[str, tuple[float, float]]:
        """Root mean square distance to each recording before and after, in its unit (m, N)."""
        each = self.observed.comparisons
        return {c.name: (c.before.root_mean_square, c.after.root_mean_square) for c in each}


class Running:
    """A case of a body that is about to be simulated; of a specimen see `run`.

    By default `elements` are those that the model needs, given what else is to be done with them, `needed_by` (see
    `choose_elements`). `model` and `chosen` are as those of `Run`.
    """

    def __init__(
        self,
        case: Case,
        course: Course | None = None,
        elements: str | None = None,
        device: str | None = None,
        precision: str = "double",
        needed_by: tuple[str, ...] = (),
    ) -> None:
        self.case = case
        self.course = course or Course()
        model = model_of(case)
        self.chosen: str | None = None
        if elements is None:
            elements, self.chosen = choose_elements(model, needed_by)
        elif elements not in ELEMENTS:
            raise InputError(f"elements = {elements!r}: expected one of {', '.join(ELEMENTS)}")
        self.model = replace(model, elements=elements)
        self.system = System(self.model, device, precision)

    def run(self, watching: Watching | None = None) -> Run:
        """Simulate it, and compare it with what was recorded; `SolveError` if there is no such state, or none was
        found.
        """
        followed = follow(self.case, self.system, self.course, watching or Watching())
        at = math.inf if followed.time is None else followed.time
        result = result_of(self.system, at)
        reached = nodal_state_of(self.system, at)
        states: Mapping[float, Any] = followed.states
        if followed.time is None:
            states = states_at_rest(self.case, self.system, reached, self.course.tolerance)
        observed = observe(self.case, reached, followed.time, states)
        return Run(self.case, self.model, self.chosen, result, observed, followed)


def run(
    case: Case | str,
    *,
    tissue: str = "multi",
    steps: int | None = None,
    to_rest: bool = False,
    until: float | None = None,
    tolerance: float = 1e-8,
    elements: str | None = None,
    device: str | None = None,
    precision: str = "double",
) -> Run | SpecimenRun:
    """Simulate a case as ``warpbrain run`` does, to its static equilibrium if nothing else is asked for.

    Parameters
    ----------
    case : Case or str
        A case, the name of a shipped one, or the path of a case folder.
    tissue : str
        ``"multi"`` or ``"single"``, of a case that is named.
    steps : int, optional
        Follow the motion for so many time steps of 1 ms.
    to_rest : bool
        Follow the damped motion until it is at rest.
    until : float, optional
        Follow slow change without inertia until then [s], in `steps` steps that grow (20).
    tolerance : float
        Out-of-balance force at the end, relative to all nodal forces.
    elements : str, optional
        ``"tet4"``, ``"tet4-averaged"``, ``"tet10"`` or ``"tet10-mixed"``; by default those that the case needs.
    device : str, optional
        ``"cpu"``, ``"cuda:0"``, ...; the GPU if there is one.
    precision : str
        ``"double"`` or ``"single"``.

    Returns
    -------
    Run or SpecimenRun
        The state beside what was recorded; of a specimen its tests.

    Raises
    ------
    InputError
        If an argument or the case is wrong: the message names it and the cure.
    SolveError
        If there is no such state: at what load or time, where and why.

    Examples
    --------
    >>> import warpbrain as wb
    >>> done = wb.run("0529", tissue="single")  # doctest: +SKIP
    >>> 1000 * abs(done.u).max()  # mm # doctest: +SKIP
    """
    case = as_case(case, tissue)
    course = Course(steps, to_rest, until, tolerance)
    if case.specimen is None:
        return Running(case, course, elements, device, precision).run()
    if course != Course(tolerance=tolerance):
        raise InputError(f"steps, to_rest, until: {case.path} has a [specimen], whose tests are quasi-static")
    return SpecimenRunning(case, tolerance, elements, device, precision).run()


def why_not(case: Case) -> str:
    """Why a sound case cannot be run as it stands; empty if it can."""
    try:
        if case.specimen is None:
            require_held(model_of(case))
            return ""
        specimen_of(case)
        for tissue in case.tissues.values():
            _ = tissue.known_law
    except InputError as error:
        return str(error).removeprefix(f"{case.path}: ")
    for recording in case.recordings:
        if isinstance(recording, TestRecording) and (why := not_transmitted(case.specimen.grips, recording.mode)):
            return f"recording '{recording.name}' mode '{recording.mode}': {why}"
    return ""
