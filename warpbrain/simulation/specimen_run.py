"""The tests of a specimen, simulated."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from warpbrain.cases.case import Case
from warpbrain.errors import InputError
from warpbrain.recordings.comparison import Comparison
from warpbrain.recordings.recording import TestRecording
from warpbrain.shown import Shown
from warpbrain.simulation.equilibrium import EquilibriumOptions
from warpbrain.simulation.specimen import Rig, TestResult, compare_test


@dataclass(frozen=True)
class Tested:
    """A test, its simulation and how far they are apart."""

    recording: TestRecording
    result: TestResult
    comparison: Comparison


@dataclass(frozen=True, eq=False)
class SpecimenRun(Shown):
    """The simulated tests of a specimen.

    Attributes
    ----------
    case : Case
    rig : Rig
    tests : tuple of Tested
    """

    case: Case
    rig: Rig
    tests: tuple[Tested, ...]

    @property
    def errors(self) -> Mapping[str, tuple[float, float]]:
        """Root mean square of each test's answer and of its error, in its unit (m, 1, rad, N, Pa, N m)."""
        compared = (test.comparison for test in self.tests)
        return {one.name: (one.before.root_mean_square, one.after.root_mean_square) for one in compared}


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
        return SpecimenRun(self.case, self.rig, tuple(self._tested(recording, on_state) for recording in self.tests))

    def _tested(self, recording: TestRecording, on_state: Callable[[float, str], None]) -> Tested:
        result = self.rig.run(recording, on_state=lambda part: on_state(part, recording.name))
        return Tested(recording, result, compare_test(recording, result))
