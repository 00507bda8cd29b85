"""Which mechanisms an ensemble can have: the same forces, or the same tissue left, for every sample."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from many_samples import computed, samples_of, shaken_block

from warpbrain.ensemble.course import Resting
from warpbrain.ensemble.workers import Job, acts_before_all
from warpbrain.errors import InputError
from warpbrain.kernels.module import PRECISIONS
from warpbrain.physics.laws import NeoHookean
from warpbrain.physics.mechanism import Mechanism
from warpbrain.physics.mechanisms import mechanisms
from warpbrain.physics.mechanisms.compressibility import Compressibility
from warpbrain.physics.mechanisms.gravity import Gravity
from warpbrain.physics.mechanisms.pressure import Pressure
from warpbrain.physics.mechanisms.resection import Resection
from warpbrain.physics.mechanisms.swelling import Swelling
from warpbrain.physics.mechanisms.traction import Traction
from warpbrain.simulation.equilibrium import solve_equilibrium
from warpbrain.simulation.model import Model, with_mechanisms
from warpbrain.simulation.relaxation import RelaxationOptions
from warpbrain.simulation.system import System


def model_with(*acting: Mechanism) -> Model:
    model = shaken_block(NeoHookean(1000.0), moves=False)
    top = model.mesh.points[:, 2] > 0.07
    return with_mechanisms(replace(model, mesh=replace(model.mesh, node_sets={"top": top})), acting)


def test_loads_act_on_every_sample() -> None:
    acting = (
        Traction(centre=(0.025, 0.025, 0.08), value=(50.0, 0.0, -100.0), radius=0.03),
        Gravity(direction=(0.0, 1.0, 0.0), density=1000.0, csf_level=0.03),
    )
    model = model_with(*acting)
    samples = samples_of(model)[:3]
    job = Job(model, tuple(samples))
    system = job.system("cpu")
    assert isinstance(job.course(), Resting)
    course = Resting(model, RelaxationOptions(tolerance=1e-8), PRECISIONS["double"])
    found = computed(system, course, samples, 2)
    for sample in samples:
        assert sample.materials is not None
        expected = solve_equilibrium(System(replace(model, materials=sample.materials), "cpu")).u
        u = found[sample.number].u
        assert u is not None
        assert np.abs(u - expected).max() < 1e-6 * np.abs(expected).max()


def test_which_those_are() -> None:
    assert {kind for kind, known in mechanisms().items() if acts_before_all(known)} >= {
        "gravity", "resection", "traction",
    }  # fmt: skip
    assert acts_before_all(Resection) and not acts_before_all(Pressure)


@pytest.mark.parametrize(
    "mechanism", [Pressure(nodes="top", value=1.0), Swelling(amount=0.1), Compressibility(poisson=0.4)]
)
def test_what_depends_on_laws_or_deformation_is_refused(mechanism: Mechanism, tmp_path: Path) -> None:
    model = model_with(mechanism)
    with pytest.raises(InputError, match=rf"cannot have the mechanism {mechanism.kind} yet: .*gravity.*resection"):
        Job(model, tuple(samples_of(model)))
