"""Specimens and tests on them, without any file."""

from pathlib import Path

import numpy as np

from warpbrain.cases.case import Case, Tissue
from warpbrain.cases.specimen import Specimen
from warpbrain.physics.laws import NeoHookean
from warpbrain.recordings.recording import TestRecording
from warpbrain.simulation.equilibrium import EquilibriumOptions
from warpbrain.simulation.model import Material
from warpbrain.simulation.specimen import STEPS, Rig, TestResult

QUANTITIES = {
    "axial": ("displacement", "force"),
    "stretch": ("stretch", "stress"),
    "shear": ("displacement", "force"),
    "torsion": ("angle", "torque"),
    "confined": ("stretch", "stress"),
    "biaxial": ("stretch", "stress"),
}
CUBE = Specimen("block", (5e-3, 5e-3, 5e-3), "glued")
BRAIN = Material(NeoHookean(1000.0), 0.45)
EXACT = EquilibriumOptions(tolerance=1e-11)


def case_of(specimen: Specimen, material: Material = BRAIN) -> Case:
    return Case(
        name="specimen",
        title="A specimen",
        origin="synthetic",
        path=Path("case.toml"),
        mesh=specimen.mesh(),
        tissues={1: Tissue("gel", material.law, material.formulation)},
        density=1000.0,
        poisson=material.poisson,
        specimen=specimen,
    )


def recorded(mode: str, imposed: list[float] | np.ndarray, response: list[float] | None = None) -> TestRecording:
    """A test; the mode "stretch" is an axial one in stretch and stress."""
    values = np.asarray(imposed, dtype=float)
    answer = np.zeros(len(values)) if response is None else np.array(response, dtype=float)
    return TestRecording(
        name="cycle 1",
        file="cycle1.csv",
        mode="axial" if mode == "stretch" else mode,
        quantities=QUANTITIES[mode],
        imposed=values,
        response=answer,
    )


def simulate_test(
    case: Case,
    recording: TestRecording,
    device: str | None = None,
    precision: str = "double",
    options: EquilibriumOptions | None = None,
    steps: int = STEPS,
) -> TestResult:
    """One test on the specimen of a case."""
    return Rig(case, device, precision, options).run(recording, steps)
