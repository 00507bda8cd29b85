"""A job: everything that decides the outcomes of an ensemble, as plain data that can travel to another machine."""

from __future__ import annotations

import hashlib
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field, replace
from importlib.metadata import version
from typing import Any

import numpy as np

from warpbrain import __version__
from warpbrain.ensemble.course import Course, Moving, Resting, step_samples
from warpbrain.ensemble.sample import Outcome, Sample
from warpbrain.errors import InputError
from warpbrain.physics.load import Load
from warpbrain.physics.mechanism import Mechanism
from warpbrain.physics.mechanisms import mechanisms
from warpbrain.simulation.model import Model
from warpbrain.simulation.relaxation import RelaxationOptions
from warpbrain.simulation.system import System, find_precision


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

    def outcomes(self, system: System, slots: int) -> Iterator[list[Outcome]]:
        """Compute the samples, `slots` at a time, on the device of a system of this job's model."""
        return step_samples(system, self.course(), self.samples, slots)

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
                digest.update(np.ascontiguousarray(item).tobytes() if isinstance(item, np.ndarray) else _text(item))
        return digest.hexdigest()


def acts_before_all(mechanism: type[Mechanism]) -> bool:
    """Whether a mechanism is done with once loads and mesh are made, whatever the laws and the deformation are."""
    return issubclass(mechanism, Load) or hasattr(mechanism, "remaining")


def _text(value: Any) -> bytes:
    return f"{value!r};".encode()
