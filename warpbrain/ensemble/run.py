"""An ensemble from a case to its spread: what `warpbrain ensemble` and `warpbrain.ensemble` do."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from warpbrain.cases.case import Case
from warpbrain.cases.shipped import as_case
from warpbrain.ensemble.choosing import drawn_samples, swept_samples
from warpbrain.ensemble.defaults import SAMPLES
from warpbrain.ensemble.job import Job
from warpbrain.ensemble.results import EnsembleResult, results_of
from warpbrain.ensemble.sample import Sample
from warpbrain.ensemble.store import Store
from warpbrain.ensemble.workers import Here, Prepare, Processes, Workers, kind_of
from warpbrain.errors import InputError, require_kind
from warpbrain.gp.process import Process
from warpbrain.gp.trained import find_model
from warpbrain.simulation.of_case import model_of


def chosen_samples(
    case: Case,
    samples: int | str,
    seed: int = 0,
    process: Process | None = None,
    on_sample: Callable[[int], None] | None = None,
) -> list[Sample]:
    """So many draws of the tissues' joint prior, or the paper's sweep (``"grid"``); `InputError` if there is none."""
    if samples == "grid":
        return swept_samples(case, process or find_model("coregionalised", "as_published"))
    if not isinstance(samples, int) or samples < 1:
        raise InputError(f"samples = {samples!r}: expected a whole number of at least 1 or 'grid', the paper's sweep")
    return drawn_samples(case, samples, seed, process or find_model("hierarchical"), on_sample)


@contextmanager
def chosen_workers(
    device: str | None, batch: int | None, processes: int, dask: str | None, prepare: Prepare
) -> Iterator[Workers]:
    """Who computes: a Dask cluster if one is named, else processes on the CPU, or this process and one device."""
    if dask is not None:
        from warpbrain.ensemble.cluster import Cluster

        with Cluster(dask, processes, device, batch, prepare) as cluster:
            yield cluster
    elif kind_of(device) == "cpu" and processes > 1:
        yield Processes(processes, batch, prepare)
    else:
        yield Here(device, batch)


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
    if processes < 1:
        raise InputError(f"processes = {processes}: expected a whole number of at least 1")
    if batch is not None and batch < 1:
        raise InputError(f"batch = {batch}: expected a whole number of at least 1")
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
