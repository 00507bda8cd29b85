"""How far elements lock in nearly incompressible tissue, and which a model has if nobody asks for others.

The figures are those of `python bench/elements.py` (docs/solvers.md): a block of irregular tetrahedra, three through
its height, that bends under its weight, beside P2-P1 elements of scikit-fem on the same mesh.
"""

from collections.abc import Sequence

import numpy as np

from warpbrain.simulation.model import Model, unaware_of_midsides

#: Above this Poisson ratio a model has elements that do not lock, if nobody asks for others.
NEARLY_INCOMPRESSIBLE = 0.49
#: Work of the block's weight, relative to that of P2-P1 elements, less 1: by Poisson ratio and elements.
MEASURED = {
    0.45: {"tet4": -0.365, "tet4-averaged": 0.033, "tet10": -0.026, "tet10-mixed": 0.020},
    0.49: {"tet4": -0.517, "tet4-averaged": -0.035, "tet10": -0.067, "tet10-mixed": 0.006},
    0.499: {"tet4": -0.661, "tet4-averaged": -0.082, "tet10": -0.141, "tet10-mixed": 0.001},
    0.4999: {"tet4": -0.727, "tet4-averaged": -0.089, "tet10": -0.200, "tet10-mixed": 0.000},
}


def largest_poisson(model: Model) -> float:
    """Of the tissues that the mesh has."""
    return max(model.materials[label].poisson for label in model.mesh.labels)


def choose_elements(model: Model, linear_only: Sequence[str] = ()) -> tuple[str, str]:
    """Elements of a model for which nobody asked for any, and why; `linear_only` is to be done with it, and cannot be
    done with nodes in the middle of edges.
    """
    poisson = largest_poisson(model)
    if poisson <= NEARLY_INCOMPRESSIBLE:
        return "tet4", f"the default up to nu = {NEARLY_INCOMPRESSIBLE:g}"
    near = f"nu = {poisson:g} is above {NEARLY_INCOMPRESSIBLE:g}, where tet4 and tet10 lock"
    against = [*linear_only, *unaware_of_midsides(model)]
    if not against:
        return "tet10-mixed", f"{near}; --elements tet4-averaged is many times as fast and less exact"
    return "tet4-averaged", f"{near}; not tet10-mixed because of {', '.join(against)}"


def locking_sentences(elements: str, poisson: float, instead: str | None = None) -> list[str]:
    """What is to be said of elements that are too stiff at a Poisson ratio: at most one sentence.

    Plain tetrahedra always are; averaged and quadratic ones where tissue is nearly incompressible. `instead` says what
    a user can do about it, if not what `warpbrain run` offers.
    """
    if elements != "tet4" and poisson <= NEARLY_INCOMPRESSIBLE:
        return []
    # the error goes with the logarithm of how far tissue is from incompressible
    nearest = min(MEASURED, key=lambda nu: abs(np.log((0.5 - nu) / (0.5 - poisson))))
    stiffer = -MEASURED[nearest][elements]
    if stiffer < 0.03:
        return []
    kind = "linear tetrahedra" if elements == "tet4" else f"elements {elements}"
    instead = instead or (
        "warpbrain run --mesh-error says what it is in a case"
        if poisson <= NEARLY_INCOMPRESSIBLE
        else "--elements tet10-mixed is not"
    )
    return [
        f"near-incompressible tissue is stiffer on {kind} than it is: at nu = {nearest:g} a coarse block of irregular "
        f"ones bends {100.0 * stiffer:.0f} % less than one of P2-P1 elements; {instead}"
    ]


def elements_of_fits(poisson: float) -> str:
    """Linear elements of fits and diagnoses, which have no others: those that lock less where tissue makes plain ones.

    Up to `NEARLY_INCOMPRESSIBLE` the error of plain ones, which elements of half the size show, is known well enough.
    """
    return "tet4" if poisson <= NEARLY_INCOMPRESSIBLE else "tet4-averaged"


def on_linear_elements(poisson: float, user: str) -> list[str]:
    """What is to be said of something that has linear tetrahedra only, of nearly incompressible tissue."""
    if poisson <= NEARLY_INCOMPRESSIBLE:
        return []
    elements = elements_of_fits(poisson)
    return locking_sentences(elements, poisson, f"{user} has no other elements, and allows for what smaller ones show")
