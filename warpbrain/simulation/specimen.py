"""A laboratory specimen between the platens of a testing machine: what it answers to what is imposed on it.

Tests are quasi-static. Of an elastic specimen a state depends on the imposed value alone, so a test is one curve of the
response. It is computed at a few imposed values, from rest outwards, each state started from the one before, and
interpolated at the rows of the test by monotone piecewise cubics (Fritsch and Butland 1984, as SciPy has them). At
stretches of 0.7 to 1.3 that errs by 0.02 % of the largest stress for a neo-Hookean law, by 0.2 % and 1 % for Ogden's at
exponents -4.7 and -12.

What has a memory (viscoelasticity) or a ramp follows the times of the test instead (`warpbrain.simulation.history`).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from warpbrain.arrays import Floats, Ints
from warpbrain.cases.case import Case
from warpbrain.cases.specimen import Specimen
from warpbrain.errors import InputError, SolveError
from warpbrain.mesh import TetMesh
from warpbrain.physics.mechanisms import mechanisms
from warpbrain.recordings.comparison import Comparison
from warpbrain.recordings.recording import TestRecording
from warpbrain.shown import Shown
from warpbrain.simulation.equilibrium import EquilibriumOptions, EquilibriumSolver
from warpbrain.simulation.history import History, history_of
from warpbrain.simulation.locking import choose_elements
from warpbrain.simulation.model import Material, Model, with_mechanisms
from warpbrain.simulation.system import System

#: Imposed values from rest to the farther extreme of a test.
STEPS = 8
#: How many times as far as was read a specimen is followed for a force that was imposed.
_FARTHER = 4
#: Modes whose states are homogeneous whatever the grips are.
HOMOGENEOUS = ("confined", "biaxial")
#: Quantities of tests as people read them: the factor from SI and the unit.
SHOWN = {
    "displacement": (1000.0, "mm"),
    "stretch": (1.0, ""),
    "angle": (1.0, "rad"),
    "force": (1.0, "N"),
    "stress": (1.0, "Pa"),
    "torque": (1.0, "N m"),
}


@dataclass(frozen=True, eq=False, kw_only=True)
class TestResult:
    """What was simulated of a test."""

    # not a test of pytest's
    __test__ = False
    #: (k,), the computed curve, `imposed` increasing and with the value at rest among it, or in the order of `time`, in
    #: the units of the recording's quantities
    imposed: Floats
    response: Floats
    #: (n,), the response at the rows of the recording; of a force-controlled test the displacement (stretch, angle)
    predicted: Floats
    residuals: Floats  # (n,), recorded less predicted
    newton: Ints  # (k,), Newton iterations that each state took; 0 at rest
    min_J: Floats  # (k,), smallest volume ratio of an element in each state
    #: Newton iterations with an indefinite tangent, see `Equilibrium`: the specimen buckled, or its law softens
    unstable_iterations: int
    time: Floats | None = None  # (k,), of each state [s]; None if a state depends on the imposed value alone

    @property
    def r_squared(self) -> float:
        """Coefficient of determination `1 - sum r^2 / sum (y - mean y)^2`; NaN if the recorded response is constant."""
        recorded = self.predicted + self.residuals
        spread = float(np.sum((recorded - recorded.mean()) ** 2))
        return 1.0 - float(np.sum(self.residuals**2)) / spread if spread > 0.0 else float("nan")


@dataclass(frozen=True)
class _State:
    """A computed point of a test's curve, see `TestResult`; by default at rest and free of stress."""

    imposed: float
    response: float = 0.0
    newton: int = 0
    min_J: float = 1.0
    unstable_iterations: int = 0
    u: Floats | None = None  # displacement (n, 3) [m] to go on from; None for rest


class Rig:
    """The specimen of a case in the testing machine, pre-processed for a device: any number of tests run on it.

    Glued ends follow the platens in all components. Lubricated ends slide freely on them, so the state is homogeneous
    and one element is exact: a tetrahedron with the specimen's height and volume that stands on the lower platen, held
    against rigid motion and nothing else. (A whole mesh would give the same stress, or buckle.)

    Between the lubricated walls of a confining chamber, and in a sheet that is stretched alike along two axes, the
    state is homogeneous too: all nodes of that element follow along the axes across z.

    Mechanisms act in full before anything is imposed, between platens that stand as far apart as the specimen was high:
    what swells then presses on them.

    `elements` are as of `Model`, of glued specimens; by default as `choose_elements` says. `mode` is one of
    `HOMOGENEOUS`, the only one of the rig's tests then. The `system` is in the state that was computed last; the clock
    of the `solver` has the wall times by phase.

    `InputError` if the case has no specimen, assumes what means nothing in one, or leaves its law to the generative
    model.
    """

    def __init__(
        self,
        case: Case,
        device: str | None = None,
        precision: str = "double",
        options: EquilibriumOptions | None = None,
        elements: str | None = None,
        mode: str = "",
    ) -> None:
        self.case, self._mode = case, mode
        self._turned: dict[str, Rig] = {}
        self._like_this = (device, precision, options)
        self.specimen = specimen_of(case)
        glued = self._glued = self.specimen.grips == "glued" and not mode
        mesh = case.mesh if glued else _homogeneous(case.mesh.volume, self.specimen.size[2])
        model = _model(case, glued, mesh, mode)
        #: Why the elements of a glued specimen were chosen; None if they were asked for.
        self.chosen: str | None = None
        if glued and elements is None:
            elements, self.chosen = choose_elements(model, ("the specimen",))
        self.system = System(replace(model, elements=elements) if glued and elements else model, device, precision)
        self.solver = EquilibriumSolver(self.system, options)
        self._top = mesh.node_sets["top"]
        #: Nodes that follow what is imposed.
        self._led = np.ones(len(mesh.points), dtype=bool) if mode == "biaxial" else self._top
        self._area = mesh.volume / self.specimen.size[2]
        self._shortest = min((t.forgets_in for t in self.system.terms if t.forgets_in is not None), default=None)

    def follows_time(self, recording: TestRecording) -> bool:
        """Whether the states of a test depend on its history."""
        ramped = any(mechanism.ramp for mechanism in self.system.model.mechanisms)
        return recording.time is not None and (self._shortest is not None or ramped)

    def check(self, recording: TestRecording) -> None:
        """`InputError` if the grips cannot transmit a test, it presses the specimen to nothing, or it has no times."""
        who = f"{self.case.path}: [[recording]] '{recording.name}'"
        if why := not_transmitted(self.specimen.grips, recording.mode):
            raise InputError(f"{who} mode '{recording.mode}': {why}")
        if recording.force_controlled and self.follows_time(recording):
            raise InputError(
                f"{who} control 'force': a specimen with a memory or a ramp is followed under displacements alone; "
                "`warpbrain diagnose` takes the test, by the stress at what was read"
            )
        if self._shortest is not None and recording.time is None:
            raise InputError(
                f"{who} file '{recording.file}': no column t, and what has a memory ([[mechanism]] viscoelasticity) "
                "cannot do without times"
            )
        lowest, height = float(recording.imposed.min()), self.specimen.size[2]
        pressed = recording.mode in ("axial", "confined")
        if pressed and recording.quantities[0] == "displacement" and lowest <= -height:
            raise InputError(
                f"{who}: found a displacement of {1000.0 * lowest:g} mm, expected more than -{1000.0 * height:g} mm, "
                "the height of the specimen"
            )

    def run(
        self, recording: TestRecording, steps: int = STEPS, on_state: Callable[[float], None] = lambda _share: None
    ) -> TestResult:
        """Simulate a test at the values that were imposed in it.

        `steps` are imposed values from rest to the extreme that is farther from it; see `imposed_values` and, of a test
        that depends on its history, `history_of`. `on_state` is called with the share of the states that are done, in
        (0, 1].

        `InputError` if the test is not possible, see `check`; `SolveError` if no equilibrium is found: in which test,
        at what imposed value, why.
        """
        self.check(recording)
        return self._along(recording)._simulate(recording, steps, on_state)

    def _along(self, recording: TestRecording) -> Rig:
        """The rig with the tissue as it lay in a test: itself if that changes nothing."""
        try:
            turned = tuple(mechanism.turned(recording.turn) for mechanism in self.case.mechanisms)
        except InputError as error:
            raise InputError(f"{self.case.path}: [[recording]] '{recording.name}' axis: {error}") from None
        mode = recording.mode if recording.mode in HOMOGENEOUS else ""
        key = f"{mode} {turned!r}"
        if key == f"{self._mode} {self.case.mechanisms!r}":
            return self
        if key not in self._turned:
            elements = self.system.model.elements if self._glued and not mode else None
            rig = Rig(replace(self.case, mechanisms=turned), *self._like_this, elements, mode)
            rig.solver.clock = self.solver.clock
            self._turned[key] = rig
        return self._turned[key]

    def _simulate(self, recording: TestRecording, steps: int, on_state: Callable[[float], None]) -> TestResult:
        """A test that is possible."""
        rest = 1.0 if recording.quantities[0] == "stretch" else 0.0
        if self.follows_time(recording):
            return self._through_time(recording, rest, steps, on_state)
        sides = imposed_values(recording.imposed, rest, steps)
        at_rest = _State(rest)
        if self.system.model.mechanisms:
            at_rest = self._solved(recording, rest, at_rest)
        states = [at_rest]
        for side in sides:
            last = at_rest
            for value in side.tolist():
                last = self._solved(recording, value, last)
                states.append(last)
                on_state((len(states) - 1) / sum(map(len, sides)))
        if recording.force_controlled:
            states += self._farther(recording, states, rest, steps)
        return _result(recording, sorted(states, key=lambda state: state.imposed))

    def _farther(self, recording: TestRecording, states: Sequence[_State], rest: float, steps: int) -> list[_State]:
        """States beyond what was read, until all forces that were imposed are answered."""
        states_beyond: list[_State] = []
        reach = max(float(np.abs(recording.imposed - rest).max()), np.finfo(float).tiny)
        for sign, force in ((-1.0, float(recording.response.min())), (1.0, float(recording.response.max()))):
            last = replace(max(states, key=lambda state: sign * state.imposed), u=None)
            for _ in range(_FARTHER * steps):
                if sign * last.response >= sign * force:
                    break
                last = self._solved(recording, last.imposed + sign * reach / steps, last)
                states_beyond.append(last)
            else:
                raise SolveError(
                    f"test '{recording.name}' ({recording.mode}): no {recording.quantities[0]} within {_FARTHER} times "
                    f"what was read answers a {recording.quantities[1]} of {force:.4g}"
                )
        return states_beyond

    def _through_time(
        self, recording: TestRecording, rest: float, steps: int, on_state: Callable[[float], None]
    ) -> TestResult:
        """A test whose states depend on its history: at rest long before the first row, whose value comes at once."""
        assert recording.time is not None
        reach = max(float(np.abs(recording.imposed - rest).max()), np.finfo(float).tiny)
        ramps = [[time for time, _ in m.ramp] for m in self.system.model.mechanisms if m.ramp]
        history = history_of(recording.time, recording.imposed, reach, steps, self._shortest, ramps)
        start, first = float(history.time[0]), float(history.imposed[0])
        self.system.forget()
        state = self._solved(recording, rest, _State(rest), math.inf, start)
        if first != rest:
            state = self._solved(recording, first, state, 0.0, start)
        states = [state]
        rows = zip(history.time.tolist(), history.imposed.tolist(), strict=True)
        for (before, _), (time, value) in itertools.pairwise(rows):
            states.append(self._solved(recording, value, states[-1], time - before, time))
            on_state(len(states) / len(history.time))
        return _result(recording, states, history)

    def _solved(
        self, recording: TestRecording, value: float, last: _State, h: float | None = None, time: float = math.inf
    ) -> _State:
        """The equilibrium at an imposed value, from the state before it; with `h`, that a time step after it at a
        time.
        """
        led = np.where(self._led[:, None], self._platen(recording, value), 0.0) * self.system.model.constrained
        try:
            if h is None:
                state = self.solver.solve(start=last.u, prescribed=led)
            else:
                state = self.solver.step(np.zeros_like(led) if last.u is None else last.u, h, time, led)
        except SolveError as error:
            quantity = recording.quantities[0]
            factor, unit = SHOWN[quantity]
            at, came = f" at {time:.4g} s", f", coming from {factor * last.imposed:.4g}"
            raise SolveError(
                f"test '{recording.name}' ({recording.mode}){'' if h is None else at}: {quantity} {factor * value:.4g} "
                f"{unit}{came if h is None else ''}: {error}"
            ) from None
        response = self._response(recording, state.u, state.internal)
        return _State(value, response, len(state.history), state.min_J, state.unstable_iterations, state.u)

    def _platen(self, recording: TestRecording, value: float) -> Floats:
        """Displacement (n, 3) [m] that the upper platen would give to each node."""
        points = self.system.model.mesh.points
        u = np.zeros_like(points)
        if recording.mode == "biaxial":
            u[:, :2] = (value - 1.0) * points[:, :2]
        elif recording.mode in ("axial", "confined"):
            u[:, 2] = value if recording.quantities[0] == "displacement" else (value - 1.0) * self.specimen.size[2]
        elif recording.mode == "shear":
            u[:, 0] = value
        else:
            x, y, c, s = points[:, 0], points[:, 1], np.cos(value), np.sin(value)
            u[:, 0], u[:, 1] = (c - 1.0) * x - s * y, s * x + (c - 1.0) * y
        return u

    def _response(self, recording: TestRecording, u: Floats, internal: Floats) -> float:
        """With what the upper platen acts on the specimen: a force [N] along z or x, a stress [Pa], or a torque [N m].

        Of a sheet the nominal stress along x, `sum f_x X / V`.

        Positive in tension, and along a positive shear or rotation.
        """
        if recording.mode == "biaxial":
            mesh = self.system.model.mesh
            return float(internal[:, 0] @ mesh.points[:, 0]) / mesh.volume
        force = internal[self._top]
        if recording.mode == "torsion":
            x, y = (self.system.model.mesh.points + u)[self._top, :2].T
            return float(np.sum(x * force[:, 1] - y * force[:, 0]))
        total = float(force[:, 0 if recording.mode == "shear" else 2].sum())
        return total / self._area if recording.quantities[1] == "stress" else total


def compare_test(recording: TestRecording, result: TestResult) -> Comparison:
    """A test beside its simulation; the residuals have one column.

    Before is a specimen that resists nothing, or that no force moves.
    """
    quantity, recorded = recording.answer
    unit = "m" if quantity == "displacement" else SHOWN[quantity][1]
    rest = 1.0 if quantity == "stretch" else 0.0
    before, after = (recorded - rest)[:, None], result.residuals[:, None]
    rows, about = np.arange(len(recorded)), (recording.name, recording.kind, recording.role, unit)
    return Comparison(*about, rows, before, after, noise=recording.sigma)


def imposed_values(imposed: Floats, rest: float, steps: int) -> tuple[Floats, Floats]:
    """Where to compute a response: below and above the value at rest, outwards, to the extremes of what was imposed.

    The distance to the farther extreme is divided by `steps`; the way to the nearer one has steps no longer than that.
    """
    ends = np.array([min(float(imposed.min()), rest), max(float(imposed.max()), rest)])
    distances = np.abs(ends - rest)
    # a side as long as the other by all but rounding takes no step more
    counts = np.ceil(steps * distances / max(float(distances.max()), np.finfo(float).tiny) - 1e-9).astype(int)
    below, above = (rest + (end - rest) * np.arange(1, n + 1) / n for end, n in zip(ends, counts, strict=True))
    return below, above


def interpolated(imposed: Floats, response: Floats, rows: Floats) -> Floats:
    """A computed curve at any imposed values between its ends, by the interpolation that tests are compared with."""
    from scipy.interpolate import PchipInterpolator

    if len(imposed) == 1:  # nothing was imposed at all
        return np.full(len(rows), response[0])
    return np.asarray(PchipInterpolator(imposed, response)(rows), dtype=np.float64)


def _result(recording: TestRecording, states: Sequence[_State], history: History | None = None) -> TestResult:
    """States in the order of their imposed values, or of their times, at the rows of the recording."""
    imposed = np.array([state.imposed for state in states])
    response = np.array([state.response for state in states])
    if recording.force_controlled:
        # what answers the forces that were imposed, by a curve that must rise
        if len(imposed) > 1 and not (np.diff(response) > 0.0).all():
            raise SolveError(
                f"test '{recording.name}' ({recording.mode}): the {recording.quantities[1]} does not rise with the "
                f"{recording.quantities[0]}: under a force the specimen is not stable"
            )
        predicted = interpolated(response, imposed, recording.response)
    elif history is None or recording.time is None:
        predicted = interpolated(imposed, response, recording.imposed)
    else:
        predicted = history.interpolated(response, recording.time)
    return TestResult(
        imposed=imposed,
        response=response,
        predicted=predicted,
        residuals=recording.answer[1] - predicted,
        newton=np.array([state.newton for state in states]),
        min_J=np.array([state.min_J for state in states]),
        unstable_iterations=sum(state.unstable_iterations for state in states),
        time=None if history is None else history.time,
    )


def specimen_of(case: Case) -> Specimen:
    """The specimen of a case, if what the case assumes means something in it; `InputError` otherwise."""
    if case.specimen is None:
        raise InputError(f"{case.path}: no [specimen]: a test needs one")
    if case.boundaries:
        raise InputError(
            f"{case.path}: [[boundary]] '{case.boundaries[0].name}': means nothing with [specimen], whose grips hold it"
        )
    for mechanism in case.mechanisms:
        who = f"{case.path}: [[mechanism]] kind = '{mechanism.kind}'"
        if not mechanism.of_specimens:
            can = ", ".join(kind for kind, mechanism_type in mechanisms().items() if mechanism_type.of_specimens)
            raise InputError(f"{who}: means nothing in a [specimen] between its grips; what can act there: {can}")
        if case.specimen.grips == "lubricated" and not mechanism.everywhere:
            raise InputError(
                f"{who}: acts in a part of the specimen, but one between lubricated grips is simulated as homogeneous: "
                'grips = "glued", or let it act everywhere'
            )
    return case.specimen


def _homogeneous(volume: float, height: float) -> TetMesh:
    """One tetrahedron with three edges along the axes, of a volume [m3] and height [m]."""
    legs = np.sqrt(6.0 * volume / height)
    points = np.vstack([np.zeros(3), np.diag([legs, legs, height])])
    bottom = np.array([True, True, True, False])
    return TetMesh(points, np.array([[0, 1, 2, 3]]), node_sets={"bottom": bottom, "top": ~bottom})


def not_transmitted(grips: str, mode: str) -> str:
    """Why grips cannot impose a mode, in words; empty if they can."""
    if grips == "lubricated" and mode in ("shear", "torsion"):
        return "lubricated grips slide, nothing transmits it"
    if grips == "glued" and mode == "biaxial":
        return "ends that are glued to platens do not widen"
    return ""


def _model(case: Case, glued: bool, mesh: TetMesh, mode: str) -> Model:
    """The specimen held by its grips, or in one of the homogeneous modes, at rest."""
    top, bottom = mesh.node_sets["top"], mesh.node_sets["bottom"]
    if mode:
        constrained = np.ones(mesh.points.shape, dtype=bool)
        # the free faces of a sheet
        constrained[top, 2] = mode != "biaxial"
    elif glued:
        constrained = np.repeat((top | bottom)[:, None], 3, axis=1)
    else:
        # the platens, and what keeps the lower face from moving and turning on its own; the upper one slides sideways,
        # as it does where fibres are oblique
        constrained = np.zeros(mesh.points.shape, dtype=bool)
        constrained[:, 2] = True
        constrained[0, :2] = True
        constrained[1, 1] = True
    [(label, tissue)] = case.tissues.items()
    try:
        material = Material(tissue.known_law, case.poisson, tissue.formulation)
        return with_mechanisms(Model(mesh, {label: material}, case.density, constrained), case.mechanisms)
    except InputError as error:
        raise InputError(f"{case.path}: [tissue.{label}] {error}") from None


@dataclass(frozen=True)
class Tested:
    """A test, its simulation and how far they are apart."""

    recording: TestRecording
    result: TestResult
    comparison: Comparison


@dataclass(frozen=True, eq=False)
class SpecimenRun(Shown):
    """The simulated tests of a specimen."""

    case: Case
    tests: tuple[Tested, ...]

    @property
    def errors(self) -> Mapping[str, tuple[float, float]]:
        """Root mean square of each test's answer and of its error, in its unit (m, 1, rad, N, Pa, N m)."""
        each = (test.comparison for test in self.tests)
        return {c.name: (c.before.root_mean_square, c.after.root_mean_square) for c in each}


class SpecimenRunning:
    """A specimen that is about to be tested; parameters as of `Rig`.

    `InputError` if nothing was tested, or a test is not possible.
    """

    def __init__(
        self,
        case: Case,
        tolerance: float = 1e-8,
        elements: str | None = None,
        device: str | None = None,
        precision: str = "double",
    ) -> None:
        self.case = case
        self.tests = tuple(recording for recording in case.recordings if isinstance(recording, TestRecording))
        if not self.tests:
            raise InputError(f"{case.path}: no [[recording]] of kind 'test': nothing is imposed on the [specimen]")
        if elements in ("tet10", "tet10-mixed"):
            raise InputError(
                f"elements = {elements!r}: {case.path} has a [specimen], whose tests have linear elements only"
            )
        self.rig = Rig(case, device, precision, EquilibriumOptions(tolerance=tolerance), elements)
        for recording in self.tests:
            self.rig.check(recording)

    def run(self, on_state: Callable[[float, str], None] = lambda _part, _name: None) -> SpecimenRun:
        """Simulate them all; `on_state` is told the part of each test that is done, and its name.

        `SolveError` if a state of a test is not found.
        """

        def tested(recording: TestRecording) -> Tested:
            result = self.rig.run(recording, on_state=lambda part: on_state(part, recording.name))
            return Tested(recording, result, compare_test(recording, result))

        return SpecimenRun(self.case, tuple(map(tested, self.tests)))
