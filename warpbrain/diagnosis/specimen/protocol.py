"""The tests of a specimen as a diagnosis sees them: few rows of each, stress over strain, in chains of one memory.

Every response is turned into a nominal stress [Pa]: a force over the area of an end, a torque over `int r dA`. Every
imposed value is turned into a strain: a stretch, a shear, or the shear at the rim of a twisted cylinder. Of a test with
times so many rows are kept that straight lines between them follow what was imposed, and that a rest is followed at
ever longer steps (`warpbrain.simulation.history`).

Tests of one mode and one specimen whose times go on from one to the next are a chain: tissue remembers the earlier one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpbrain.cases.specimen import Specimen
from warpbrain.recordings.recording import TestRecording
from warpbrain.simulation.history import corners_of, history_of

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Steps of a diagnosis from rest to the largest imposed value, rows of a test without times, and the part of a test's
#: duration that the first step of a rest takes.
_STEPS, _ROWS, _FIRST = 4, 60, 0.005
#: What a stress is called in each mode, for people.
MODES = {"axial": "axial", "shear": "shear", "torsion": "torsion"}


@dataclass(frozen=True, eq=False)
class Test:
    """One test.

    Attributes
    ----------
    name, mode, specimen : str
    fitted : bool
        Whether its role is to be fitted.
    strain, stress : (n,) array
        Stretch or shear, and nominal stress [Pa], at the rows that are kept.
    time : (n,) array or None
        [s]
    sigma : float
        Of a reading [Pa]: as declared, or as rough as the record is.
    unit : float
        Pascals of one unit of the recording's response.
    """

    # not a test of pytest's
    __test__ = False
    name: str
    mode: str
    specimen: str
    fitted: bool
    strain: Floats
    stress: Floats
    time: Floats | None
    sigma: float
    unit: float

    @property
    def rest(self) -> float:
        """Strain at rest."""
        return 1.0 if self.mode == "axial" else 0.0

    @property
    def peak(self) -> float:
        """Largest stress [Pa], by which noise and nuisances are scaled."""
        return float(np.abs(self.stress).max())

    @property
    def path(self) -> Floats:
        """Way (n,) along the test from 0: strain that was gone through over the largest, and the share of its time."""
        reach = max(float(np.abs(self.strain - self.rest).max()), 1e-12)
        gone = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(self.strain)))]) / reach
        if self.time is None:
            return gone
        return gone + (self.time - self.time[0]) / max(float(np.ptp(self.time)), 1e-12)


@dataclass(frozen=True, eq=False)
class Chain:
    """Tests that tissue goes through one after the other.

    Attributes
    ----------
    tests : tuple of int
        Their numbers in the protocol.
    strain : (n,) array
        Of all of them.
    time : (n,) array or None
    """

    tests: tuple[int, ...]
    strain: Floats
    time: Floats | None


@dataclass(frozen=True, eq=False)
class Protocol:
    """All tests.

    Attributes
    ----------
    tests : tuple of Test
    chains : tuple of Chain
        Whose rows one after the other are those of the tests.
    rows : tuple of slice
        Of each test among all rows.
    """

    tests: tuple[Test, ...]
    chains: tuple[Chain, ...]
    rows: tuple[slice, ...]

    def __len__(self) -> int:
        return self.rows[-1].stop

    @property
    def observed(self) -> Floats:
        """Stress (n,) at all rows [Pa]."""
        return np.concatenate([test.stress for test in self.tests])

    def mask(self, tests: Sequence[int]) -> NDArray[np.bool_]:
        """The rows (n,) of some tests."""
        found = np.zeros(len(self), dtype=bool)
        for number in tests:
            found[self.rows[number]] = True
        return found

    @property
    def to_fit(self) -> tuple[int, ...]:
        """Numbers of the tests that may be fitted."""
        return tuple(k for k, test in enumerate(self.tests) if test.fitted)

    @property
    def to_check(self) -> tuple[int, ...]:
        """Numbers of those that may not."""
        return tuple(k for k, test in enumerate(self.tests) if not test.fitted)

    @property
    def specimens(self) -> tuple[str, ...]:
        """On which the tests were run."""
        return tuple(dict.fromkeys(test.specimen for test in self.tests))


def protocol_of(specimen: Specimen, recordings: Sequence[TestRecording]) -> Protocol:
    """The tests of a case, in the order of their recordings."""
    return protocol(tuple(test_of(specimen, recording) for recording in recordings))


def protocol(tests: tuple[Test, ...]) -> Protocol:
    """Tests in chains."""
    ends = np.cumsum([len(test.strain) for test in tests])
    rows = tuple(slice(int(end) - len(test.strain), int(end)) for end, test in zip(ends, tests, strict=True))
    groups: list[list[int]] = []
    for number, test in enumerate(tests):
        if groups and _goes_on(tests[groups[-1][-1]], test):
            groups[-1].append(number)
        else:
            groups.append([number])
    chains = []
    for group in groups:
        times = [test.time for k, test in enumerate(tests) if k in group and test.time is not None]
        strain = np.concatenate([tests[k].strain for k in group])
        chains.append(Chain(tuple(group), strain, np.concatenate(times) if times else None))
    return Protocol(tests, tuple(chains), rows)


def _goes_on(before: Test, after: Test) -> bool:
    same = before.mode == after.mode and before.specimen == after.specimen
    return same and before.time is not None and after.time is not None and bool(after.time[0] > before.time[-1])


def test_of(specimen: Specimen, recording: TestRecording) -> Test:
    """A recording in stress and strain, at the rows that are kept."""
    unit = stress_unit(specimen, recording)
    strain = strain_of(specimen, recording.mode, recording.quantities[0], recording.imposed)
    stress = unit * recording.response
    rest = 1.0 if recording.mode == "axial" else 0.0
    if recording.time is None:
        kept = np.unique(np.linspace(0, len(strain) - 1, min(_ROWS, len(strain))).round().astype(np.int64))
    else:
        kept = _kept(recording.time, strain, rest)
    sigma = unit * recording.sigma if recording.sigma is not None else roughness(stress)
    return Test(
        name=recording.name,
        mode=recording.mode,
        specimen=recording.specimen,
        fitted=recording.role == "fit",
        strain=strain[kept],
        stress=stress[kept],
        time=None if recording.time is None else recording.time[kept],
        sigma=sigma,
        unit=unit,
    )


test_of.__test__ = False  # type: ignore[attr-defined]  # not a test of pytest's


def strain_of(specimen: Specimen, mode: str, quantity: str, imposed: Floats) -> Floats:
    """Stretch or shear of what was imposed."""
    height = specimen.size[2]
    if mode == "axial":
        return imposed if quantity == "stretch" else 1.0 + imposed / height
    return imposed / height if mode == "shear" else imposed * radius_of(specimen) / height


def stress_unit(specimen: Specimen, recording: TestRecording) -> float:
    """Nominal stress [Pa] of one unit of the recording's response."""
    radius = radius_of(specimen)
    area = np.pi * radius**2
    of_one = {"stress": 1.0, "force": 1.0 / area, "torque": 1.0 / (2.0 / 3.0 * np.pi * radius**3)}
    return of_one[recording.quantities[1]]


def radius_of(specimen: Specimen) -> float:
    """Radius [m] of the circle that is as large as an end."""
    x, y, _ = specimen.size
    return 0.5 * x if specimen.shape == "cylinder" else float(np.sqrt(x * y / np.pi))


def roughness(values: Floats) -> float:
    """Standard deviation of what is independent from row to row: second differences, which smooth parts have not."""
    if len(values) < 5:
        return 0.0
    second = values[2:] - 2.0 * values[1:-1] + values[:-2]
    return float(1.4826 * np.median(np.abs(second - np.median(second))) / np.sqrt(6.0))


def _kept(time: Floats, strain: Floats, rest: float) -> Ints:
    """Rows of a record in time that are enough of it."""
    reach = max(float(np.abs(strain - rest).max()), 1e-12)
    history = history_of(time, strain, reach, _STEPS, _FIRST * float(np.ptp(time)))
    wanted = np.searchsorted(time, history.time).clip(0, len(time) - 1)
    return np.unique(np.concatenate([wanted, np.array(corners_of(time, strain, 0.02 * reach))])).astype(np.int64)
