"""Results, cases and meshes shown: drawn in three dimensions (`warpbrain.plot`), and as a table for notebooks
(`warpbrain.html`, `page/notebook.html`)."""

import math
from collections.abc import Callable
from functools import singledispatch
from pathlib import Path
from typing import Any

import numpy as np

from warpbrain.cases.case import Case
from warpbrain.diagnosis.result import Diagnosis
from warpbrain.ensemble.results import EnsembleResult
from warpbrain.errors import InputError
from warpbrain.estimation.posterior import Posterior
from warpbrain.mesh import TetMesh
from warpbrain.report.comparison import SHOWN
from warpbrain.report.diagnosis.files import file_of_map
from warpbrain.report.ensemble import describe_ensemble, ensemble_lines, file_of_fields
from warpbrain.report.estimate import file_of_estimate
from warpbrain.report.files import MILLIMETRES, body_file, file_of_result, sets_of
from warpbrain.report.page import part
from warpbrain.report.summary import SET_TITLES, describe_result, left_out, show_lines
from warpbrain.report.views import TISSUE_COLOURS
from warpbrain.simulation.result import Result
from warpbrain.simulation.run import Run
from warpbrain.simulation.specimen import SpecimenRun
from warpbrain.worlds.specimen.result import SpecimenDiagnosis

#: What the fields are called that are shown unless another is asked for, and in which colours.
_UNITS = {
    "displacement": "displacement\n[mm]",
    "displacement_mean": "mean displacement\n[mm]",
    "displacement_sd": "standard deviation\n[mm]",
    "score": "score\n(chi-squared)",
    "von_mises": "von Mises stress\n[Pa]",
    "J": "volume ratio J",
    "fluid_pressure": "fluid pressure\n[Pa]",
}

#: Where it is looked at from, by the normal of the cut.
_SIDES: dict[str | None, tuple[float, float, float]] = {
    "x": (1.0, 0.6, 0.4),
    "y": (0.6, 1.0, 0.4),
    "z": (0.0, -0.5, 1.0),
    None: (0.8, 0.85, 0.62),
}
#: Beside the body, not over it.
_BAR = {"vertical": True, "position_x": 0.87, "position_y": 0.2, "height": 0.6, "title_font_size": 16}


def plot(
    what: Any,
    *,
    field: str | None = None,
    exaggeration: float = 1.0,
    cut: str | None = "x",
    view: tuple[float, float, float] | None = None,
    show: bool = True,
    screenshot: str | Path | None = None,
) -> Any:
    """Draw a result, a case or a mesh.

    Parameters
    ----------
    what : Run, Result, Posterior, Diagnosis, EnsembleResult, SpecimenRun, Case or TetMesh
    field : str, optional
        An array of the file that a command writes of it, such as ``"von_mises"`` (docs/results.md): by default the
        displacement, of a diagnosis where the mismatch is, of a case or mesh the tissue. Of a posterior also
        ``"moduli"``: the densities before and after.
    exaggeration : float
        How many times as far as it moves the body is drawn moved.
    cut : {"x", "y", "z"} or None
        Normal of a plane through the middle, one side of which is taken away: x is left and right, y back and front,
        z down and up.
    view : (float, float, float), optional
        Where it is looked at from, in RAS: by default towards the cut.
    show : bool
        Open a window, or draw into the notebook; otherwise only make the plotter.
    screenshot : path, optional
        PNG file to write, without a window.

    Returns
    -------
    pyvista.Plotter or matplotlib.figure.Figure
        The figure of curves, of a specimen's tests and of moduli.

    Raises
    ------
    InputError
        If it cannot be drawn, or has no such field: the message lists those it has.
    """
    figure = None
    if isinstance(what, SpecimenRun):
        from warpbrain.report.specimen import COLUMNS, tests_figure

        figure = tests_figure(what.tests, COLUMNS)
    elif isinstance(what, Posterior) and field == "moduli":
        from warpbrain.report.estimate_page import densities_figure

        figure = densities_figure(what, narrow=False)
    if figure is not None:
        if screenshot is not None:
            figure.savefig(screenshot)
        return figure
    if cut not in _SIDES:
        raise InputError(f"cut = {cut!r}: expected 'x', 'y', 'z' or None")
    import pyvista

    file, usual = _file(what)
    body = pyvista.from_meshio(file)
    name = usual if field is None else field
    known = [*body.point_data, *body.cell_data]
    if name not in known:
        raise InputError(f"field = {name!r}: there is none in a {type(what).__name__}; it has {', '.join(known)}")
    moves = next((key for key in ("displacement", "displacement_mean") if key in body.point_data), None)
    if moves is not None:
        body.points = body.points + exaggeration * body.point_data[moves]
    shown = body if cut is None else body.clip(normal=cut)
    plotter = pyvista.Plotter(off_screen=True if screenshot is not None else None)
    categories = name == "tissue"
    plotter.add_mesh(
        shown,
        scalars=name,
        cmap=list(TISSUE_COLOURS) if categories else "viridis",
        smooth_shading=True,
        split_sharp_edges=True,
        categories=categories,
        show_scalar_bar=not categories,
        scalar_bar_args={"title": f"{_UNITS.get(name, name)}\n", "color": "#333333", "fmt": "%.3g", **_BAR},
    )
    plotter.set_background("white")
    plotter.add_axes(xlabel="R", ylabel="A", zlabel="S", color="#333333")
    side = view or _SIDES[cut]
    plotter.view_vector(side, viewup=(0.0, 1.0, 0.0) if cut == "z" and view is None else (0.0, 0.0, 1.0))
    plotter.camera.zoom(1.1)
    if screenshot is not None:
        plotter.show(screenshot=str(screenshot))
    elif show:
        plotter.show()
    return plotter


def grid(what: Any) -> Any:
    """What `plot` draws as a `pyvista.UnstructuredGrid` in mm with all its arrays, for pictures of one's own."""
    import pyvista

    return pyvista.from_meshio(_file(what)[0])


@singledispatch
def _file(what: Any) -> tuple[Any, str]:
    """A `meshio.Mesh` in mm, and the field of it that is shown unless another is asked for."""
    raise InputError(
        f"what: expected a result, a case or a mesh, found {type(what).__name__}: "
        "what warpbrain.run, estimate, diagnose, ensemble and find_case return can be drawn"
    )


_file.register(TetMesh, lambda what: (body_file(what, sets_of(what.node_sets), sets_of(what.element_sets)), "tissue"))
_file.register(Case, lambda what: _file(what.mesh))
_file.register(Result, lambda what: (file_of_result(what), "displacement"))
_file.register(Run, lambda what: _file(what.result))
_file.register(Posterior, lambda what: (file_of_estimate(what), "displacement"))
_file.register(Diagnosis, lambda what: (file_of_map(what), "score"))


@_file.register
def _(what: EnsembleResult) -> tuple[Any, str]:
    if what.fields is None:
        raise InputError("what: no sample of this ensemble has an answer; the reasons are in its rows")
    return file_of_fields(what.fields), "displacement_sd"


#: By what it is, the macro that tells it, and what this takes beside it.
_TOLD: dict[type, tuple[str, Callable[[Any], tuple[Any, ...]]]] = {
    Case: ("case", lambda case: (show_lines(case),)),
    Result: ("result", lambda result: (describe_result(result), SET_TITLES)),
    Run: ("run", lambda run: (MILLIMETRES * np.linalg.norm(run.u, axis=1).max(), left_out(run.model), SHOWN)),
    SpecimenRun: ("specimen", lambda run: (SHOWN,)),
    Posterior: ("posterior", lambda posterior: (math.exp,)),
    Diagnosis: ("diagnosis", lambda diagnosis: ()),
    SpecimenDiagnosis: ("diagnosis", lambda diagnosis: ()),
    EnsembleResult: ("ensemble", lambda result: (ensemble_lines(describe_ensemble(result)),)),
}


def html(what: Any) -> str:
    """A result or a case as HTML: a title and a table.

    Raises
    ------
    InputError
        If it is none of these.
    """
    for kind, (macro, values) in _TOLD.items():
        if isinstance(what, kind):
            return str(part(macro, what, *values(what), template="notebook.html"))
    raise InputError(f"what: expected a result or a case, found {type(what).__name__}")
