"""The twelve groups of studies, named method/anatomy, as the paper numbers them: `task = 4 method + anatomy`."""

from __future__ import annotations

#: How a study measured, in the paper's order: elastography, linear elasticity, hyperelasticity.
METHODS = ("MRE", "linear", "hyperelastic")
#: What it measured, in the paper's order.
ANATOMIES = ("grey matter", "white matter", "brain", "abnormal")
#: Names of the groups; the place of a name is its task, 0 to 11.
GROUPS = tuple(f"{method}/{anatomy}" for method in METHODS for anatomy in ANATOMIES)

#: Stretches (low, high) on which the paper samples a group: what a study gets that names none.
STRETCHES: dict[str, tuple[float, float]] = {
    **{f"MRE/{anatomy}": (0.95, 1.05) for anatomy in ANATOMIES},
    **{f"linear/{anatomy}": (0.9, 1.1) for anatomy in ANATOMIES},
    "hyperelastic/grey matter": (0.9, 1.1),
    "hyperelastic/white matter": (0.9, 1.1),
    "hyperelastic/brain": (0.6, 1.4),
    "hyperelastic/abnormal": (0.8, 1.2),
}


def task_of(group: str) -> int:
    """Task of a group, `4 method + anatomy` (0 to 11).

    Examples
    --------
    >>> task_of("hyperelastic/brain")
    10
    """
    return GROUPS.index(group)


def usual_form(group: str) -> str:
    """The form of a study that names none: linear for elastography and linear studies, else neo-Hookean."""
    return "neo-hookean" if group.startswith("hyperelastic/") else "linear"
