"""A job, everything that decides the outcomes of an ensemble as plain data, and who computes it: this process, or
processes of this machine (a cluster of others is in its own file).

A part of a job is a pure function of what it is given, and every sample has the same bits wherever it is computed: who
computes which part decides nothing. Warp's kernels on the CPU run on one thread, so there a process for each processor.
"""

from __future__ import annotations

import hashlib
import os
import signal
import threading
import time
from collections.abc import Callable, Collection, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field, replace
from importlib.metadata import version
from multiprocessing import active_children, get_context
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from warpbrain import __version__
from warpbrain.ensemble.batch import parts_of_clusters
from warpbrain.ensemble.course import Course, Moving, Resting, step_samples
from warpbrain.ensemble.sample import Outcome, Sample
from warpbrain.errors import InputError, SolveError
from warpbrain.kernels.batched.layout import TANGENT
from warpbrain.kernels.module import find_device, find_precision
from warpbrain.physics.load import Load
from warpbrain.physics.mechanism import Mechanism
from warpbrain.physics.mechanisms import mechanisms
from warpbrain.simulation.model import Model
from warpbrain.simulation.relaxation import RelaxationOptions
from warpbrain.simulation.system import System


def _versions() -> dict[str, str]:
    return {"warpbrain": __version__, "warp-lang": version("warp-lang")}


@dataclass(frozen=True)
class Job:
    """Samples of a model and the course that they take."""

    model: Model  # its own materials are not used
    samples: tuple[Sample, ...]
    steps: int | None = None  # time steps; None: to rest
    time_step: float = 0.001  # of a motion [s]
    tolerance: float = 1e-8  # of rest; see `warpbrain.simulation.relaxation.RelaxationOptions`
    precision: str = "double"  # ``"double"`` or ``"single"``
    #: Of this machine's packages; a worker must have the same
    versions: dict[str, str] = field(default_factory=_versions)

    def __post_init__(self) -> None:
        if self.model.mechanisms:
            kinds = ", ".join(dict.fromkeys(mechanism.kind for mechanism in self.model.mechanisms))
            alike = ", ".join(kind for kind, known in mechanisms().items() if acts_before_all(known))
            raise InputError(
                f"an ensemble cannot have the mechanism {kinds} yet: only what is the same forces, or the same tissue "
                f"left, for every sample ({alike})"
            )
        if self.model.elements != "tet4":
            raise InputError(f"an ensemble cannot have elements '{self.model.elements}' yet: expected tet4")

    def part(self, numbers: Collection[int]) -> Job:
        """The same job for some of its samples, by number."""
        return replace(self, samples=tuple(sample for sample in self.samples if sample.number in numbers))

    def course(self) -> Course:
        """A new course for a batch of these samples."""
        if self.steps is not None:
            return Moving(self.model, self.steps, self.time_step)
        return Resting(self.model, RelaxationOptions(tolerance=self.tolerance), find_precision(self.precision))

    def system(self, device: str | None) -> System:
        """The model on a device; `InputError` on a machine of other versions than the job's: bits would be others."""
        if self.versions != _versions():
            raise InputError(f"a worker has {_versions()}, the job was made with {self.versions}")
        return System(self.model, device, self.precision)

    def outcomes(self, device: str | None, batch: int | None) -> Iterator[list[Outcome]]:
        """Compute the samples on a device, so many at a time, or as many as its memory holds and pay."""
        system = self.system(device)
        return step_samples(system, self.course(), self.samples, batch_size(system, batch))

    def fingerprint(self, kind: str) -> str:
        """A hash of all that decides the outcomes' bits; `kind` is that of the devices, ``"cpu"`` or ``"cuda"``."""
        model = self.model
        digest = hashlib.sha256()
        parts: list[Any] = [model.mesh.points, model.mesh.tetrahedra, model.mesh.tissue, model.constrained]
        parts += [model.prescribed, model.external_forces(), model.density, model.damping, list(model.loads)]
        parts += [(motion.nodes, motion.times, motion.values) for motion in model.motions]
        parts += [(s.number, s.reason, sorted((s.materials or {}).items())) for s in self.samples]
        parts += [self.steps, self.time_step, self.tolerance, self.precision, sorted(self.versions.items()), kind]
        for part in parts:
            for item in part if isinstance(part, tuple) else (part,):
                digest.update(item.tobytes() if isinstance(item, np.ndarray) else f"{item!r};".encode())
        return digest.hexdigest()


def acts_before_all(mechanism: type[Mechanism]) -> bool:
    """Whether a mechanism is done with once loads and mesh are made, whatever the laws and the deformation are."""
    return issubclass(mechanism, Load) or hasattr(mechanism, "remaining")


#: Samples beyond which a batch is no faster a sample, by kind of device; docs/ensembles.md has the times. On a CPU a
#: few at a time are as fast as one, and more only take room in its cache.
ENOUGH = {"cpu": 1, "cuda": 256}
#: Part of the free memory that a batch may take.
SHARE = 0.8


def bytes_per_slot(system: System) -> int:
    """Memory that a sample takes in a batch: element results, matrix, vectors and sums."""
    n, m = system.size, system.elements
    elements = m * (4 * 3 + 1)
    matrix = len(system.pairs) * 9
    # u, u at the start of the step and what leaves the device are in double precision
    displacements = 3 * 3 * n
    # v, dv, v at the start of the step, prescribed velocity, internal forces, b
    vectors = 6 * 3 * n
    if parts_of_clusters(system) is not None:
        # what several patches have of a pair: half as much, at most
        matrix += matrix // 2
    else:
        # tangents; z, p, q and the preconditioner
        elements += m * TANGENT
        vectors += 3 * 3 * n + 6 * n
    sums = 2 * n
    # and these are in either precision
    parameters = sum(1 + len(material.law.parameters()) for material in system.model.materials.values())
    others = elements + matrix + vectors + sums + parameters
    return 8 * (displacements + parameters) + system.precision.numpy.itemsize * others


def free_bytes(system: System) -> int:
    if system.device.is_cuda:
        return int(system.device.free_memory)
    for line in Path("/proc/meminfo").read_text().splitlines() if Path("/proc/meminfo").exists() else ():
        if line.startswith("MemAvailable:"):
            return 1024 * int(line.split()[1])
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") // 2


def batch_size(system: System, samples: int | None = None) -> int:
    """Samples of a batch: as many as are asked for, or as many as the memory holds and pay; `InputError` if not one."""
    each = bytes_per_slot(system)
    room = int(SHARE * free_bytes(system)) // each
    if room < (samples or 1):
        raise InputError(
            f"--batch {samples or 'auto'}: a sample takes {each / 1e6:.0f} MB, and {system.device.alias} has room for "
            f"{room}"
        )
    return samples or min(room, ENOUGH["cuda" if system.device.is_cuda else "cpu"])


#: Parts that each worker gets: the more, the less the others wait for the last.
PARTS_EACH = 8

#: Called on a worker before each part.
Prepare = Callable[[], object]


class Workers(Protocol):
    """Computes jobs."""

    kind: str  # of its devices, ``"cpu"`` or ``"cuda"``: bits differ between the two
    name: str  # for people

    def outcomes(self, job: Job) -> Iterator[list[Outcome]]:
        """Outcomes of all samples of a job, as they become known."""


class Here:
    """This process and one device; samples at a time as many as the memory holds and pay, unless `batch` is said."""

    def __init__(self, device: str | None, batch: int | None) -> None:
        self._device, self._batch = find_device(device), batch
        self.kind = kind_of(device)
        self.name = f"{self._device.name} ({self._device.alias})"

    def outcomes(self, job: Job) -> Iterator[list[Outcome]]:
        return job.outcomes(self._device.alias, self._batch)


class Processes:
    """Processes of this machine, each on the CPU, and prepared before each part."""

    def __init__(self, count: int, batch: int | None, prepare: Prepare) -> None:
        self._count, self._batch, self._prepare = count, batch, prepare
        self.kind = "cpu"
        self.name = f"{count} processes on {find_device('cpu').name}"

    def outcomes(self, job: Job) -> Iterator[list[Outcome]]:
        """See `Workers`; `SolveError` if a process is ended from outside."""
        context, others = get_context("spawn"), active_children()
        pool = ProcessPoolExecutor(self._count, context, _live_with, (os.getpid(),))
        try:
            parts = parts_of(job, self._count, self._batch or ENOUGH["cpu"])
            pending = [pool.submit(compute_part, part, "cpu", self._batch, self._prepare) for part in parts]
            for part in as_completed(pending):
                yield part.result()
        except BrokenProcessPool:
            raise SolveError("a worker process was ended; the same command goes on with what is missing") from None
        finally:
            # `kill_workers` of Python 3.14. What they compute is wanted no more, and the interpreter would wait for it;
            # one that is still starting would print that this process is gone
            workers = [process for process in active_children() if process not in others]
            pool.shutdown(wait=False, cancel_futures=True)
            for worker in workers:
                worker.kill()


def kind_of(device: str | None) -> str:
    """``"cpu"`` or ``"cuda"``."""
    return "cuda" if find_device(device).is_cuda else "cpu"


def compute_part(job: Job, device: str | None, batch: int | None, prepare: Prepare) -> list[Outcome]:
    """All outcomes of a job: what a worker does."""
    prepare()
    return [outcome for ended in job.outcomes(device, batch) for outcome in ended]


def parts_of(job: Job, workers: int, least: int) -> list[Job]:
    """The job in parts of like stiffness, of at least so many samples; the soft ones, which take longest, first."""
    samples = sorted(job.samples, key=lambda sample: (sample.stiffness, sample.number))
    size = max(least, -(-len(samples) // (PARTS_EACH * workers)))
    return [job.part({s.number for s in samples[k : k + size]}) for k in range(0, len(samples), size)]


def _live_with(parent: int) -> None:
    """Prepare a worker process: it ends with its parent, however that ends; Ctrl-C is left to that."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(0.5)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
