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

from functools import cache
from importlib import import_module
from typing import Any

#: Rooms of the house that are public names themselves: `cases` can be asked for a case, `ensemble` can be called.
_ROOMS = ("cases", "ensemble")


@cache
def _homes() -> dict[str, str]:
    """Modules of the public names, which are imported when they are first used, so that `import warpbrain` loads
    nothing heavy. `__init__.pyi`, which type checkers and editors read, says where they are. Without `__all__`,
    `help(warpbrain)` is the page above and not all that can be said of every class."""
    import re
    from pathlib import Path

    stub = Path(__file__).with_name("__init__.pyi").read_text(encoding="utf-8")
    pairs = re.findall(r"^from (warpbrain\.[\w.]+) import \w+ as (\w+)$", stub, re.MULTILINE)
    return {name: home for home, name in pairs if name not in _ROOMS}


def __getattr__(name: str) -> Any:
    if name == "__version__":
        return _version()
    if name.startswith("_"):
        raise AttributeError(name)
    if name in _ROOMS:
        return import_module(f"warpbrain.{name}")
    if name == "laws":
        return import_module("warpbrain.physics.laws").LAWS
    if name == "mechanisms":
        return import_module("warpbrain.physics.mechanisms").mechanisms()
    if name in _homes():
        return getattr(import_module(_homes()[name]), name)
    from warpbrain.problems import nearest

    cure = nearest(name, __dir__(), "dir(warpbrain) lists what there is")
    raise AttributeError(f"module 'warpbrain' has no attribute '{name}': {cure}")


def _version() -> str:
    """Of what is installed: a tag, or the commit since; it takes longer to look up than all else here."""
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("warpbrain")
    except PackageNotFoundError:  # its sources, not installed
        return "0+unknown"


def __dir__() -> list[str]:
    return sorted([*_homes(), *_ROOMS, "laws", "mechanisms"])
