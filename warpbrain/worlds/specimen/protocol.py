"""The tests of a specimen: stress over strain at the recorded rows, in chains of one memory; fewer rows for inference.

Every response is turned into a nominal stress [Pa]: a force over the area of an end, a torque over `int r dA`. Every
imposed value is turned into a strain: a stretch, a shear, or the shear at the rim of a twisted cylinder.

A `Protocol` has all recorded rows, of which every printed error is; thinned it has those of which densities are: of a
test with times so many that straight lines between them follow what was imposed, and that a rest is followed at ever
longer steps (`warpbrain.simulation.history`). What a test is measured by (its largest stress and strain, its strain
path) is that of the whole record in both.

Tests of one mode and one specimen whose times go on from one to the next are a chain: tissue remembers the earlier one.

Noise is independent readings, and a smooth part that a stretch of a curve shares: errors of a curve are alike from row
to row, of a mean over specimens, of a gauge, of a shape that is not quite what was measured. Taking them for
independent makes any difference significant. Its scale is unknown and is summed over. How alike two rows are is
Matern's function of order 5/2: such errors have a slope and a curvature, but not every derivative, as a Gaussian
function would have it (Stein 1999, Interpolation of Spatial Data, section 1.7). With a Gaussian one a misfit of a fifth
of a curve is no surprise as long as it is smooth, and one of a twentieth with a bend is.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from warpbrain.arrays import Bools, Floats, Ints
from warpbrain.cases.specimen import REST, Specimen
from warpbrain.inference.beliefs import belief
from warpbrain.recordings.recording import TestRecording
from warpbrain.simulation.history import corners_of, history_of

#: Steps from rest to the largest imposed value, rows of a test without times, and the part of a test's duration that
#: the first step of a rest takes: how rows are chosen.
_STEPS, _ROWS, _FIRST = 4, 60, 0.005
#: Patterns of a test at most, the smoothest.
_PATTERNS = 8


@dataclass(frozen=True, eq=False)
class Test:
    """One test at n rows."""

    # not a test of pytest's
    __test__ = False
    name: str
    mode: str
    specimen: str
    #: Whether its role is to be fitted.
    fitted: bool
    #: Of its recording (n,).
    rows: Ints
    #: Stretch or shear (n,), nominal stress (n,) [Pa], and time (n,) [s].
    strain: Floats
    stress: Floats
    time: Floats | None
    #: Absolute changes of strain so far (n,), summed, over the largest strain.
    strain_path: Floats
    #: Noise of a reading [Pa]: as declared, or as rough as the record is; pascals of one unit of what was recorded.
    sigma: float
    unit: float
    #: Largest stress [Pa] and distance of a strain from rest of the whole record.
    peak: float
    reach: float
    #: From directions of the tissue to those of the machine (3, 3).
    turn: Floats

    @property
    def rest(self) -> float:
        """Strain at rest."""
        return REST[self.mode]

    @property
    def share(self) -> Floats:
        """Part (n,) of its time that is over; zeros without times."""
        if self.time is None:
            return np.zeros(len(self.strain))
        return (self.time - self.time[0]) / max(float(np.ptp(self.time)), 1e-12)

    @property
    def path(self) -> Floats:
        """Progress (n,) of the test from 0: strain path and part of its time together."""
        return self.strain_path + self.share

    def at(self, rows: Ints) -> Test:
        """The test at some of its rows, by their places among them."""
        columns = {name: getattr(self, name)[rows] for name in ("rows", "strain", "stress", "strain_path")}
        return replace(self, **columns, time=None if self.time is None else self.time[rows])


@dataclass(frozen=True, eq=False)
class Chain:
    """Tests that tissue goes through one after the other: their numbers, and strain and time (n,) of all of them."""

    tests: tuple[int, ...]
    strain: Floats
    time: Floats | None


@dataclass(frozen=True, eq=False)
class Protocol:
    """All tests; rows of its chains one after the other are those of the tests."""

    tests: tuple[Test, ...]

    def __len__(self) -> int:
        return self.rows[-1].stop

    @cached_property
    def rows(self) -> tuple[slice, ...]:
        """Of each test among all rows."""
        ends = np.cumsum([0, *(len(test.strain) for test in self.tests)]).tolist()
        return tuple(slice(first, last) for first, last in itertools.pairwise(ends))

    @cached_property
    def chains(self) -> tuple[Chain, ...]:
        """Of tests of one memory."""
        groups: list[list[int]] = []
        for number, test in enumerate(self.tests):
            if groups and _goes_on(self.tests[groups[-1][-1]], test):
                groups[-1].append(number)
            else:
                groups.append([number])
        chains = []
        for group in groups:
            times = [time for k in group if (time := self.tests[k].time) is not None]
            strain = np.concatenate([self.tests[k].strain for k in group])
            chains.append(Chain(tuple(group), strain, np.concatenate(times) if times else None))
        return tuple(chains)

    @cached_property
    def observed(self) -> Floats:
        """Stress (n,) at all rows [Pa]."""
        return np.concatenate([test.stress for test in self.tests])

    @cached_property
    def test_of(self) -> Ints:
        """Number (n,) of the test of each row."""
        return np.repeat(np.arange(len(self.tests)), [len(test.strain) for test in self.tests])

    @property
    def peaks(self) -> Floats:
        """Largest stress of the test (n,) of each row [Pa]."""
        return np.array([test.peak for test in self.tests])[self.test_of]

    def mask(self, tests: Sequence[int]) -> Bools:
        """The rows (n,) of some tests."""
        return np.isin(self.test_of, tests)

    @property
    def to_fit(self) -> tuple[int, ...]:
        """Numbers of the tests that may be fitted."""
        return tuple(k for k, test in enumerate(self.tests) if test.fitted)

    @property
    def by_test(self) -> bool:
        """Whether each of these is held out in turn: of an only one quarters are."""
        return len(self.to_fit) > 1

    @cached_property
    def fitted(self) -> Bools:
        """The rows (n,) of the tests that may be fitted."""
        return self.mask(self.to_fit)

    @property
    def specimens(self) -> tuple[str, ...]:
        """On which the tests were run."""
        return tuple(dict.fromkeys(test.specimen for test in self.tests))

    @cached_property
    def thinned(self) -> Protocol:
        """The same tests at the rows that densities are of."""
        return Protocol(tuple(test.at(_kept(test)) for test in self.tests))

    def spread(self, of_thinned: Floats) -> Floats:
        """Values (m,) of thinned rows at all of them (n,): straight from one to the next."""
        each = [
            np.interp(test.rows, sparse.rows, of_thinned[rows])
            for test, sparse, rows in zip(self.tests, self.thinned.tests, self.thinned.rows, strict=True)
        ]
        return np.concatenate(each)


def protocol_of(specimen: Specimen, recordings: Sequence[TestRecording]) -> Protocol:
    """The tests of a case at all their rows, in the order of their recordings."""
    return Protocol(tuple(_test(specimen, recording) for recording in recordings))


def _goes_on(before: Test, after: Test) -> bool:
    same = before.mode == after.mode and before.specimen == after.specimen and np.allclose(before.turn, after.turn)
    return same and before.time is not None and after.time is not None and bool(after.time[0] > before.time[-1])


def _test(specimen: Specimen, recording: TestRecording) -> Test:
    """A recording in stress and strain."""
    unit = specimen.stress_unit(recording.quantities[1])
    strain = specimen.strain_of(recording.mode, recording.quantities[0], recording.imposed)
    stress, rows = unit * recording.response, np.arange(len(strain))
    reach = max(float(np.abs(strain - REST[recording.mode]).max()), 1e-12)
    # its strain path and its noise follow from the rest
    test = Test(
        recording.name, recording.mode, recording.specimen, recording.role == "fit", rows, strain, stress,
        recording.time, np.zeros(len(strain)), 0.0, unit, float(np.abs(stress).max()), reach, recording.turn,
    )  # fmt: skip
    # without the jitter of a reading, which would make every path long
    kept = _kept(test)
    strain_path = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(strain[kept])))]) / reach
    sigma = _reading(specimen, recording, test)
    return replace(test, strain_path=np.interp(rows, kept, strain_path), sigma=sigma)


def _reading(specimen: Specimen, recording: TestRecording, test: Test) -> float:
    """Noise of a reading [Pa]: as declared, or as rough as the record is.

    Where the force was imposed the strain was read, and its noise is that of a stress by the secant to the largest one:
    the stress at a strain is compared, whatever the machine imposed.
    """
    if not recording.force_controlled:
        return _roughness(test.stress) if recording.sigma is None else test.unit * recording.sigma
    stiffness = test.peak / test.reach
    if recording.sigma is None:
        return stiffness * _roughness(test.strain)
    # strains are linear in what was read
    zero, deviation = specimen.strain_of(recording.mode, recording.quantities[0], np.array([0.0, recording.sigma]))
    return stiffness * abs(float(deviation - zero))


def _roughness(values: Floats) -> float:
    """Standard deviation of what is independent from row to row: second differences, which smooth parts have not."""
    if len(values) < 5:
        return 0.0
    second = np.diff(values, 2)
    return float(1.4826 * np.median(np.abs(second - np.median(second))) / np.sqrt(6.0))


def _kept(test: Test) -> Ints:
    """Rows of a record that are enough of it, the first and the last among them."""
    count = len(test.strain)
    if test.time is None:
        return np.unique(np.linspace(0, count - 1, min(_ROWS, count)).round().astype(np.int64))
    history = history_of(test.time, test.strain, test.reach, _STEPS, _FIRST * float(np.ptp(test.time)))
    wanted = np.searchsorted(test.time, history.time).clip(0, count - 1)
    corners = np.array(corners_of(test.time, test.strain, 0.02 * test.reach))
    return np.unique(np.concatenate([wanted, corners])).astype(np.int64)


def noise_factor(protocol: Protocol) -> Floats:
    """Lower triangular factor (n, n) of the covariance [Pa^2]."""
    covariance = np.zeros((len(protocol), len(protocol)))
    for test, rows in zip(protocol.tests, protocol.rows, strict=True):
        reading = max(test.sigma, belief("specimen.reading") * test.peak)
        shared = (belief("specimen.shared") * test.peak) ** 2 * _matern(test, belief("specimen.reach"))
        covariance[rows, rows] = reading**2 * np.eye(len(test.strain)) + shared
    return np.asarray(np.linalg.cholesky(covariance))


def smooth_patterns(protocol: Protocol, reach: float) -> Floats:
    """Columns (n, 8 per test at most) of any smooth change of a test, as large as its largest stress."""
    columns = []
    for test, rows in zip(protocol.tests, protocol.rows, strict=True):
        values, vectors = np.linalg.eigh(_matern(test, reach))
        of_test = np.zeros((len(protocol), min(_PATTERNS, len(values))))
        of_test[rows] = test.peak * vectors[:, -_PATTERNS:] * np.sqrt(np.maximum(values[-_PATTERNS:], 0.0))
        columns.append(of_test)
    return np.concatenate(columns, axis=1)


def _matern(test: Test, reach: float) -> Floats:
    away = np.sqrt(5.0) * np.abs(test.path[:, None] - test.path[None]) / reach
    return np.asarray((1.0 + away + away**2 / 3.0) * np.exp(-away))
