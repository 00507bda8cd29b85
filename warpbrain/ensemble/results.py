"""What an ensemble says: a row for each sample, and the displacement's mean, spread and percentiles at every node."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.cases.case import Case
from warpbrain.ensemble.sample import Outcome, Sample
from warpbrain.mesh import TetMesh
from warpbrain.recordings.comparison import Comparison
from warpbrain.shown import Shown
from warpbrain.simulation.observation import observe
from warpbrain.simulation.result import NodalState, Statistics, displacement_statistics

#: Percentiles of the fields.
PERCENTILES = (5, 50, 95)


@dataclass(frozen=True)
class Row:
    """A sample and how it ended."""

    sample: Sample
    outcome: Outcome  # without its fields, which `Fields` sums up
    displacement: Mapping[str, Statistics]  # by node set; empty if it failed
    comparisons: tuple[Comparison, ...]  # with the case's recordings; empty if it failed

    def error(self, recording: str) -> float:
        """Root mean square error at a recording, in its unit."""
        return next(c.after.root_mean_square for c in self.comparisons if c.name == recording)


@dataclass(frozen=True)
class Spread:
    """Mean, standard deviation and percentiles of a quantity over the samples."""

    mean: Floats
    sd: Floats  # of the samples themselves, with their number as its divisor
    percentiles: Mapping[int, Floats]


@dataclass(frozen=True)
class Fields:
    """The displacement over the samples that have an answer."""

    mesh: TetMesh
    count: int
    components: Spread  # of each component [m], arrays (n, 3)
    size: Spread  # of its size [m], arrays (n,)


@dataclass(frozen=True)
class EnsembleResult(Shown):
    """Everything that an ensemble says.

    Attributes
    ----------
    rows : tuple of Row
        By number.
    fields : Fields or None
        None if no sample has an answer.
    displacement : mapping of str to Spread
        Of the samples' mean displacement by node set [m].
    errors : mapping of str to Spread
        Of the samples' root mean square errors by recording, in its unit.
    not_compared : tuple of str
        Why some recordings are not compared, a sentence each.
    """

    rows: tuple[Row, ...]
    fields: Fields | None
    displacement: Mapping[str, Spread]
    errors: Mapping[str, Spread]
    not_compared: tuple[str, ...]

    @property
    def failed(self) -> tuple[Row, ...]:
        """Samples without an answer."""
        return tuple(row for row in self.rows if row.outcome.failed)

    @property
    def done(self) -> tuple[Row, ...]:
        """Samples with one."""
        return tuple(row for row in self.rows if not row.outcome.failed)

    def nearest(self, recording: str) -> Row:
        """The sample with the least error at a recording."""
        return min(self.done, key=lambda row: row.error(recording))


def results_of(
    case: Case,
    mesh: TetMesh,
    samples: Sequence[Sample],
    outcomes: Iterable[Outcome],
    to_rest: bool,
    on_sample: Callable[[int], None] | None = None,
) -> EnsembleResult:
    """Sum up the outcomes of samples, one for each in any order, on the mesh of the case's model.

    States at rest (`to_rest`) are compared with the end of each recording. `on_sample` is called with the count so far.
    """
    by_number = {sample.number: sample for sample in samples}
    rows: dict[int, Row] = {}
    states: dict[int, Floats] = {}
    not_compared: dict[str, None] = {}
    for outcome in outcomes:
        displacement: Mapping[str, Statistics] = {}
        comparisons: tuple[Comparison, ...] = ()
        if not outcome.failed:
            states[outcome.number] = outcome.u
            displacement = displacement_statistics(mesh, outcome.u)
            observed = observe(case, NodalState(mesh, outcome.u, outcome.reactions), None if to_rest else outcome.time)
            comparisons = observed.comparisons
            not_compared.update(dict.fromkeys(observed.skipped))
        rows[outcome.number] = Row(by_number[outcome.number], outcome.without_fields(), displacement, comparisons)
        if on_sample is not None:
            on_sample(len(rows))
    # by number: sums over samples then have one order, whoever computed which of them when
    u = np.array([states[number] for number in sorted(states)])
    fields = None
    if len(u):
        fields = Fields(mesh, len(u), spread_of(u), spread_of(np.linalg.norm(u, axis=2)))
    ordered = tuple(rows[number] for number in sorted(rows))
    done = [row for row in ordered if not row.outcome.failed]
    sets = done[0].displacement if done else ()
    recordings = [comparison.name for comparison in done[0].comparisons] if done else []
    return EnsembleResult(
        ordered,
        fields,
        {name: spread_of(np.array([row.displacement[name].mean for row in done])) for name in sets},
        {name: spread_of(np.array([row.error(name) for row in done])) for name in recordings},
        tuple(not_compared),
    )


def spread_of(values: Floats) -> Spread:
    """Mean, standard deviation and percentiles over the first axis."""
    levels = np.percentile(values, PERCENTILES, axis=0)
    return Spread(values.mean(axis=0), values.std(axis=0), dict(zip(PERCENTILES, levels, strict=True)))
