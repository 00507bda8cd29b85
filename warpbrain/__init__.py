"""Simulates the deformation of the brain, on CPU and GPU from one source, and says what it left out.

The public names are listed here once. They are imported when they are first used, so that `import warpbrain` itself
loads nothing heavy.

Examples
--------
>>> import warpbrain
>>> model, _ = warpbrain.model_of(warpbrain.find_case("0529"))
>>> model.mesh.volume < 1.1654e-3  # the resected tissue is gone
True
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

_HOMES = {
    "errors": ("InputError", "SolveError"),
    "mesh": ("MeshError", "TetMesh", "read_mesh", "write_mesh"),
    "physics.laws": ("Law", "MooneyRivlin", "NeoHookean", "Ogden"),
    "physics.laws.stability": ("require_stable",),
    "physics.force": ("NodalForce",),
    "physics.mechanisms.gravity": ("Gravity",),
    "physics.mechanisms.resection": ("Resection",),
    "simulation.model": ("Damping", "Material", "Model"),
    "simulation.of_case": ("model_of",),
    "simulation.system": ("System",),
    "simulation.equilibrium": ("Equilibrium", "EquilibriumOptions", "EquilibriumSolver", "solve_equilibrium"),
    "simulation.dynamics": ("Simulator",),
    "simulation.relaxation": ("relax_to_rest",),
    "simulation.result": ("Result", "result_of"),
    "gp.literature.studies": ("read_studies",),
    "gp.trained": ("find_model", "trained"),
    "gp.sampling": ("draw_laws",),
    "gp.prior": ("Prior",),
    "cases.case": ("Case",),
    "cases.drawn": ("with_prior_draw",),
    "cases.reading": ("read_case",),
    "cases.shipped": ("find_case",),
    "cases.writing": ("write_case",),
    "cases.checking": ("check_case",),
    "simulation.observation": ("observe",),
    "estimation.estimate": ("estimate",),
    "estimation.options": ("EstimationOptions",),
    "diagnosis.diagnose": ("diagnose",),
    "diagnosis.options": ("DiagnosisOptions",),
    "diagnosis.result": ("Diagnosis",),
}
_HOME = {name: home for home, names in _HOMES.items() for name in names}

__all__ = [
    "Case",
    "Damping",
    "Diagnosis",
    "DiagnosisOptions",
    "Equilibrium",
    "EquilibriumOptions",
    "EquilibriumSolver",
    "EstimationOptions",
    "Gravity",
    "InputError",
    "Law",
    "Material",
    "MeshError",
    "Model",
    "MooneyRivlin",
    "NeoHookean",
    "NodalForce",
    "Ogden",
    "Prior",
    "Resection",
    "Result",
    "Simulator",
    "SolveError",
    "System",
    "TetMesh",
    "check_case",
    "diagnose",
    "draw_laws",
    "estimate",
    "find_case",
    "find_model",
    "model_of",
    "observe",
    "read_case",
    "read_mesh",
    "read_studies",
    "relax_to_rest",
    "require_stable",
    "result_of",
    "solve_equilibrium",
    "trained",
    "with_prior_draw",
    "write_case",
    "write_mesh",
]

if TYPE_CHECKING:
    from warpbrain.cases.case import Case
    from warpbrain.cases.checking import check_case
    from warpbrain.cases.drawn import with_prior_draw
    from warpbrain.cases.reading import read_case
    from warpbrain.cases.shipped import find_case
    from warpbrain.cases.writing import write_case
    from warpbrain.diagnosis.diagnose import diagnose
    from warpbrain.diagnosis.options import DiagnosisOptions
    from warpbrain.diagnosis.result import Diagnosis
    from warpbrain.errors import InputError, SolveError
    from warpbrain.estimation.estimate import estimate
    from warpbrain.estimation.options import EstimationOptions
    from warpbrain.gp.literature.studies import read_studies
    from warpbrain.gp.prior import Prior
    from warpbrain.gp.sampling import draw_laws
    from warpbrain.gp.trained import find_model, trained
    from warpbrain.mesh import MeshError, TetMesh, read_mesh, write_mesh
    from warpbrain.physics.force import NodalForce
    from warpbrain.physics.laws import Law, MooneyRivlin, NeoHookean, Ogden
    from warpbrain.physics.laws.stability import require_stable
    from warpbrain.physics.mechanisms.gravity import Gravity
    from warpbrain.physics.mechanisms.resection import Resection
    from warpbrain.simulation.dynamics import Simulator
    from warpbrain.simulation.equilibrium import (
        Equilibrium,
        EquilibriumOptions,
        EquilibriumSolver,
        solve_equilibrium,
    )
    from warpbrain.simulation.model import Damping, Material, Model
    from warpbrain.simulation.observation import observe
    from warpbrain.simulation.of_case import model_of
    from warpbrain.simulation.relaxation import relax_to_rest
    from warpbrain.simulation.result import Result, result_of
    from warpbrain.simulation.system import System


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'warpbrain' has no attribute '{name}'")
    return getattr(import_module(f"warpbrain.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)
