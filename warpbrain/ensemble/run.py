"""An ensemble from a case to its spread: what `warpbrain ensemble` and `warpbrain.ensemble` do."""

from bisect import bisect_left
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path

import numpy as np

from warpbrain.cases.case import Case
from warpbrain.cases.drawn import require_groups, with_prior_draw
from warpbrain.cases.shipped import as_case
from warpbrain.ensemble.results import EnsembleResult, results_of
from warpbrain.ensemble.sample import Sample
from warpbrain.ensemble.store import Store
from warpbrain.ensemble.workers import Here, Job, Prepare, Processes, Workers, kind_of
from warpbrain.errors import InputError, SolveError, require_kind
from warpbrain.gp.process import Process
from warpbrain.gp.sampling import SWEEP, law_of_curve, unstable
from warpbrain.gp.trained import find_model
from warpbrain.physics.laws import Law
from warpbrain.simulation.equilibrium import EquilibriumOptions, EquilibriumSolver
from warpbrain.simulation.model import Material, Model
from warpbrain.simulation.of_case import model_of
from warpbrain.simulation.system import System

#: Samples unless others are asked for: as many as the paper's sweep of two tissues has.
SAMPLES = 289


def swept_samples(case: Case, process: Process) -> list[Sample]:
    """The paper's sweep: the laws of the curves `k` standard deviations from the mean, 17 `k` in [-2, 2] a tissue.

    One tissue makes 17 samples, two make the 289 pairs, the last tissue fastest. A law that is not stable is a sample
    without materials. `InputError` if a tissue has no group, or one that the process has seen no study of; for more
    than two tissues.
    """
    labels = tuple(sorted(case.tissues))
    require_groups(case, labels, process)
    if len(labels) > 2:
        raise InputError(f"{case.path}: the paper's sweep is over one or two tissues; this case has {len(labels)}")
    fits, reasons = {}, {}
    for label, k in product(labels, SWEEP):
        tissue = case.tissues[label]
        fits[label, k] = fitted = law_of_curve(process, tissue.prior, k, tissue.model)
        reasons[label, k] = unstable(fitted, case.poisson, tissue.formulation)
    samples = []
    for number, steps in enumerate(product(SWEEP, repeat=len(labels))):
        deviations = dict(zip(labels, steps, strict=True))
        reason = next((f"tissue {at[0]}: {reasons[at]}" for at in deviations.items() if reasons[at]), "")
        laws = {} if reason else {at[0]: fits[at].law() for at in deviations.items()}
        samples.append(Sample(number, None if reason else _materials(case, laws), reason, deviations))
    return samples


def _materials(case: Case, laws: Mapping[int, Law]) -> dict[int, Material]:
    return {label: Material(law, case.poisson, case.tissues[label].formulation) for label, law in laws.items()}


#: How exact the estimate has to be: it decides on a sign.
_TOLERANCE = 1e-2


def least_stretch(model: Model, device: str | None = None) -> float:
    """The least principal stretch of any element in linear elasticity; below zero no tissue is left of one.

    ``min eig(I + (H + H^T) / 2)`` with the displacement gradient H of the body under its full load, with the stiffness
    that it has at rest. A body stiffens as it is compressed, so it may bear what this says it does not. Errors are
    those of `EquilibriumSolver.linear_estimate`.
    """
    system = System(model, device)
    solver = EquilibriumSolver(system, EquilibriumOptions(cg_tolerance=_TOLERANCE))
    system.u.assign(solver.linear_estimate())
    F = system.deformation_gradients()
    return float(np.linalg.eigvalsh(0.5 * (F + F.transpose(0, 2, 1))).min())


@dataclass(frozen=True)
class Overload:
    """Samples that are too soft for the load, by `least_stretch`."""

    numbers: tuple[int, ...]
    #: Part of the load that leaves some tissue of every element of the softest one, in that estimate; 1 if none is too
    #: soft, nan if it has no linear estimate
    share: float


def overloaded(model: Model, samples: Sequence[Sample], device: str | None = None) -> Overload:
    """Samples that are too soft for the load, and what part of it all of them bear.

    Samples are taken in the order of their stiffness and the first that bears the load is found by bisection: a few
    linear solves, however many samples there are. `InputError` as of `least_stretch`.
    """

    def stiffness(sample: Sample) -> float:
        """Mean logarithm of the shear moduli [Pa]."""
        return float(np.mean([np.log(material.law.shear_modulus) for material in (sample.materials or {}).values()]))

    ordered = sorted((sample for sample in samples if sample.materials is not None), key=stiffness)

    def stretch_of(sample: Sample) -> float:
        assert sample.materials is not None
        try:
            return least_stretch(replace(model, materials=sample.materials), device)
        except SolveError:
            return float("nan")

    first = bisect_left(ordered, True, key=lambda sample: stretch_of(sample) > 0.0)
    # the stretch is one less what grows with the load
    share = 1.0 / (1.0 - stretch_of(ordered[0])) if first else 1.0
    return Overload(tuple(sorted(sample.number for sample in ordered[:first])), share)


def chosen_samples(
    case: Case,
    samples: int | str,
    seed: int = 0,
    process: Process | None = None,
    on_sample: Callable[[int], None] = lambda _number: None,
) -> list[Sample]:
    """So many draws of the tissues' joint prior, from 0 on, or the paper's sweep (``"grid"``).

    A draw of which no stable law is found is a sample without materials. `InputError` if there is no such number of
    samples, or a tissue has no group or one that the process has seen no study of.
    """
    if samples == "grid":
        return swept_samples(case, process or find_model("coregionalised", "as_published"))
    if not isinstance(samples, int) or samples < 1:
        raise InputError(f"samples = {samples!r}: expected a whole number of at least 1 or 'grid', the paper's sweep")
    process = process or find_model("hierarchical")
    require_groups(case, tuple(sorted(case.tissues)), process)
    chosen = []
    for number in range(samples):
        try:
            drawn = with_prior_draw(case, number, seed, process)
            laws = {label: tissue.known_law for label, tissue in drawn.case.tissues.items()}
            chosen.append(Sample(number, _materials(case, laws)))
        except SolveError as error:
            chosen.append(Sample(number, None, str(error).removeprefix(f"{case.path}: ")))
        on_sample(number)
    return chosen


def chosen_workers(
    device: str | None, batch: int | None, processes: int, dask: str | None, prepare: Prepare
) -> AbstractContextManager[Workers]:
    """Who computes: a Dask cluster if one is named, else processes on the CPU, or this process and one device."""
    if dask is not None:
        from warpbrain.ensemble.cluster import Cluster

        return Cluster(dask, processes, device, batch, prepare)
    if kind_of(device) == "cpu" and processes > 1:
        return nullcontext(Processes(processes, batch, prepare))
    return nullcontext(Here(device, batch))


def compute_missing(
    job: Job, store: Store, workers: Workers, on_done: Callable[[int], None] = lambda _count: None
) -> int:
    """Compute the samples that a store lacks; `on_done` is told how many are done. Returns how many they were."""
    missing = {sample.number for sample in job.samples} - store.numbers()
    done = 0
    for ended in workers.outcomes(job.part(missing)) if missing else ():
        store.write(ended)
        done += len(ended)
        on_done(done)
    return done


def ensemble(
    case: Case | str,
    samples: int | str | Sequence[Sample] = SAMPLES,
    *,
    tissue: str = "multi",
    seed: int = 0,
    process: Process | None = None,
    steps: int | None = None,
    tolerance: float = 1e-8,
    device: str | None = None,
    precision: str = "double",
    batch: int | None = None,
    processes: int = 1,
    dask: str | None = None,
    folder: str | Path | None = None,
) -> EnsembleResult:
    """Simulate a case with many laws, to rest or for some steps, as ``warpbrain ensemble`` does.

    Parameters
    ----------
    case : Case or str
        A case, the name of a shipped one, or the path of a case folder.
    samples : int, "grid" or sequence of Sample
        So many draws of the tissues' joint prior, the paper's sweep, or one's own.
    tissue : str
        ``"multi"`` or ``"single"``, of a case that is named.
    seed : int
        Another sequence of draws.
    process : Process, optional
        The generative model that is drawn from.
    steps : int, optional
        Follow the motion for so many steps of 1 ms; by default to rest.
    tolerance : float
        Out-of-balance force at rest, relative to all nodal forces.
    device : str, optional
        ``"cpu"``, ``"cuda:0"``, ...; the GPU if there is one.
    precision : str
        ``"double"`` or ``"single"``.
    batch : int, optional
        Samples at a time on a device; by default what its memory holds and pays.
    processes : int
        On the CPU. A script that asks for more than one needs ``if __name__ == "__main__":``, since each imports it.
    dask : str, optional
        Address of a Dask scheduler, or ``"local:N"`` for N processes of this machine.
    folder : path, optional
        Where outcomes are kept: a call that was killed goes on with what is missing.

    Raises
    ------
    InputError
        If an argument or the case is wrong: the message names it and the cure.
    """
    case = as_case(case, tissue)
    if case.specimen is not None:
        raise InputError(f"case: {case.path} has a [specimen]: its tests are run one by one: see warpbrain.run")
    for name, count in (("processes", processes), ("batch", batch)):
        if count is not None and count < 1:
            raise InputError(f"{name} = {count}: expected a whole number of at least 1")
    if dask is not None:
        require_kind(dask, str, "dask", 'the address of a scheduler, or "local:N"')
    numbered = chosen_samples(case, samples, seed, process) if isinstance(samples, int | str) else list(samples)
    model = model_of(case)
    job = Job(model, tuple(numbered), steps=steps, tolerance=tolerance, precision=precision)
    # there is nothing to prepare workers by
    with chosen_workers(device, batch, processes, dask, tuple) as workers:
        if folder is None:
            outcomes = [outcome for ended in workers.outcomes(job) for outcome in ended]
            return results_of(case, model.mesh, numbered, outcomes, steps is None)
        store = Store(Path(folder), job, workers.kind, {"case": case.name, "samples": len(numbered)})
        compute_missing(job, store, workers)
        return results_of(case, model.mesh, numbered, store.outcomes(), steps is None)
