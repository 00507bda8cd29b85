"""Simulates the deformation of the brain, on CPU and GPU from one source, and says what it left out.

>>> import warpbrain as wb
>>> done = wb.run("0529")                      # a shipped case, a folder, or a Case; done.errors, done.u [m]
>>> posterior = wb.estimate("0529")            # tissue from what was recorded, with intervals
>>> diagnosis = wb.diagnose("0529")            # what physics the case leaves out: diagnosis.sentence
>>> spread = wb.ensemble("0529", samples=289)  # many laws at once
>>> done.plot()                                # PyVista; or wb.plot(done, field="von_mises")

cases                              shipped ones by name; read_case, write_case, check_case: your own
laws, mechanisms                   what tissue may be and what may act on it, by name; assume(case, "gravity")
model_of, System, solve_equilibrium, Simulator, relax_to_rest, result_of, observe    the steps of run
draw_laws, Prior, find_model, with_prior_draw    what the literature makes likely of tissue
InputError, SolveError             what went wrong: the argument and the cure, or where there is no answer
dir(wb) names everything, help(wb.run) says more of one; `warpbrain --help` is the same in a shell.
"""

from importlib import import_module
from typing import Any

#: Where each public name is. They are imported when they are first used, so that `import warpbrain` loads nothing
#: heavy; type checkers and editors read `__init__.pyi`. Without `__all__`, `help(warpbrain)` is the page above and not
#: all that can be said of every class.

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
    "simulation.run": ("Run", "run"),
    "simulation.specimen_run": ("SpecimenRun",),
    "report.plot": ("grid", "plot"),
    "report.in_notebook": ("html",),
    "cases.assuming": ("assume",),
    "estimation.posterior": ("Posterior",),
    "ensemble.results": ("EnsembleResult",),
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
    "worlds.options": ("DiagnosisOptions",),
    "diagnosis.result": ("Diagnosis",),
}
_HOME = {name: home for home, names in _HOMES.items() for name in names}
#: Rooms of the house that are public names themselves: `cases` can be asked for a case, `ensemble` can be called.
_ROOMS = ("cases", "ensemble")


def __getattr__(name: str) -> Any:
    if name in _HOME:
        return getattr(import_module(f"warpbrain.{_HOME[name]}"), name)
    if name in _ROOMS:
        return import_module(f"warpbrain.{name}")
    if name == "laws":
        return import_module("warpbrain.physics.laws").LAWS
    if name == "mechanisms":
        return import_module("warpbrain.physics.mechanisms").mechanisms()
    if name == "__version__":
        return _version()
    if name.startswith("_"):
        raise AttributeError(name)
    from difflib import get_close_matches

    near = get_close_matches(name, __dir__(), 1)
    cure = f"did you mean '{near[0]}'?" if near else "dir(warpbrain) lists what there is"
    raise AttributeError(f"module 'warpbrain' has no attribute '{name}': {cure}")


def _version() -> str:
    """Of what is installed: a tag, or the commit since; it takes longer to look up than all else here."""
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("warpbrain")
    except PackageNotFoundError:  # its sources, not installed
        return "0+unknown"


def __dir__() -> list[str]:
    return sorted([*_HOME, *_ROOMS, "laws", "mechanisms"])
