"""What `warpbrain/__init__.py` imports lazily, for type checkers and editors."""

from collections.abc import Mapping

from warpbrain.cases.assuming import assume as assume
from warpbrain.cases.case import Case as Case
from warpbrain.cases.checking import check_case as check_case
from warpbrain.cases.drawn import with_prior_draw as with_prior_draw
from warpbrain.cases.reading import read_case as read_case
from warpbrain.cases.shipped import find_case as find_case
from warpbrain.cases.writing import write_case as write_case
from warpbrain.diagnosis.diagnose import diagnose as diagnose
from warpbrain.diagnosis.result import Diagnosis as Diagnosis
from warpbrain.ensemble.results import EnsembleResult as EnsembleResult
from warpbrain.ensemble.run import ensemble as ensemble
from warpbrain.errors import InputError as InputError
from warpbrain.errors import SolveError as SolveError
from warpbrain.estimation.estimate import estimate as estimate
from warpbrain.estimation.options import EstimationOptions as EstimationOptions
from warpbrain.estimation.posterior import Posterior as Posterior
from warpbrain.gp.literature.studies import read_studies as read_studies
from warpbrain.gp.prior import Prior as Prior
from warpbrain.gp.sampling import draw_laws as draw_laws
from warpbrain.gp.trained import find_model as find_model
from warpbrain.gp.trained import trained as trained
from warpbrain.mesh import MeshError as MeshError
from warpbrain.mesh import TetMesh as TetMesh
from warpbrain.mesh import read_mesh as read_mesh
from warpbrain.mesh import write_mesh as write_mesh
from warpbrain.physics.laws import Law as Law
from warpbrain.physics.laws import MooneyRivlin as MooneyRivlin
from warpbrain.physics.laws import NeoHookean as NeoHookean
from warpbrain.physics.laws import Ogden as Ogden
from warpbrain.physics.laws.stability import require_stable as require_stable
from warpbrain.physics.load import NodalForce as NodalForce
from warpbrain.physics.mechanism import Mechanism
from warpbrain.physics.mechanisms.gravity import Gravity as Gravity
from warpbrain.physics.mechanisms.resection import Resection as Resection
from warpbrain.report.plot import grid as grid
from warpbrain.report.plot import html as html
from warpbrain.report.plot import plot as plot
from warpbrain.simulation.dynamics import Simulator as Simulator
from warpbrain.simulation.equilibrium import Equilibrium as Equilibrium
from warpbrain.simulation.equilibrium import EquilibriumOptions as EquilibriumOptions
from warpbrain.simulation.equilibrium import EquilibriumSolver as EquilibriumSolver
from warpbrain.simulation.equilibrium import solve_equilibrium as solve_equilibrium
from warpbrain.simulation.model import Damping as Damping
from warpbrain.simulation.model import Material as Material
from warpbrain.simulation.model import Model as Model
from warpbrain.simulation.observation import observe as observe
from warpbrain.simulation.of_case import model_of as model_of
from warpbrain.simulation.relaxation import relax_to_rest as relax_to_rest
from warpbrain.simulation.result import Result as Result
from warpbrain.simulation.result import result_of as result_of
from warpbrain.simulation.run import Run as Run
from warpbrain.simulation.run import run as run
from warpbrain.simulation.specimen import SpecimenRun as SpecimenRun
from warpbrain.simulation.system import System as System
from warpbrain.worlds.options import DiagnosisOptions as DiagnosisOptions

__version__: str
cases: Mapping[str, Case]
laws: Mapping[str, type[Law]]
mechanisms: Mapping[str, type[Mechanism]]
