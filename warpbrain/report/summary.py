"""What a run prints and writes as JSON: dictionaries, from which printed tables are made, too; and a case in words."""

import platform
from collections.abc import Mapping
from importlib.metadata import version
from typing import Any

from warpbrain import __version__
from warpbrain.cases.case import Case, Tissue
from warpbrain.cases.checking import remarks_on_loads
from warpbrain.cases.drawn import FromPrior
from warpbrain.gp.process import Process
from warpbrain.mesh import measure
from warpbrain.physics.mechanisms import mechanisms
from warpbrain.physics.words import tabled
from warpbrain.report.files import MILLIMETRES, fingerprints, picked
from warpbrain.report.page import lines
from warpbrain.simulation.locking import NEARLY_INCOMPRESSIBLE, largest_poisson, locking_sentences
from warpbrain.simulation.model import Model, unaware_of_midsides
from warpbrain.simulation.result import Result
from warpbrain.simulation.system import System

#: Said wherever a stand-in is met.
STAND_IN = "a stand-in: the MNI anatomy deformed and scaled to the paper's volume, not the patient's images"
#: What is said of the displacements of a set.
_SIZES = ("mean", "root_mean_square", "percentile_95", "largest")
#: How the node sets are called where users read them.
SET_TITLES = {
    "all nodes": "all nodes",
    "ventricle": "ventricles",
    "resection": "cavity margin",
    "surface": "outer surface",
    "superior": "superior cap",
    "fixed": "skull base (fixed)",
}


def left_out(model: Model, instead: str | None = None) -> list[str]:
    """What a model leaves out, a sentence each; `instead` as of `locking_sentences`."""
    unaware = unaware_of_midsides(model)
    if instead is None and unaware and largest_poisson(model) > NEARLY_INCOMPRESSIBLE:
        instead = f"{', '.join(unaware)} cannot act on tet10-mixed, which do not lock"
    assumed = {type(mechanism) for mechanism in (*model.mechanisms, *model.loads)}
    absent = [each.absence for each in mechanisms().values() if each.absence and each not in assumed]
    sentences = [f"not assumed: {'; '.join(absent)}"] if absent else []
    return [*sentences, *locking_sentences(model.elements, largest_poisson(model), instead)]


def machine() -> dict[str, str]:
    """Versions and the machine, for a result that can be traced."""
    packages = ("warp-lang", "numpy", "scipy", "meshio")
    return {
        "warpbrain": __version__,
        **{name: version(name) for name in packages},
        "python": platform.python_version(),
        "platform": platform.platform(),
    }


def describe_case(case: Case, model: Model, chosen: str | None = None) -> dict[str, Any]:
    """Anatomy and assumptions of a case, with units; `chosen` says why the elements were, if nobody asked for them."""
    return {
        **picked(case, "name", "title", "origin"),
        "file": str(case.path),
        "nodes": len(model.mesh.points),
        "tetrahedra": len(model.mesh.tetrahedra),
        "elements": model.elements,
        "elements_chosen": "asked for" if chosen is None else chosen,
        "midside_nodes": len(model.node_mesh.points) - len(model.mesh.points),
        "volume_cm3": 1e6 * model.mesh.volume,
        "volume_before_resection_cm3": 1e6 * case.mesh.volume,
        "mass_kg": model.mass,
        "density_kg_per_m3": model.density,
        "poisson": case.poisson,
        "tissues": {
            str(label): {"name": t.name, "law": t.known_law.name, "formulation": t.formulation, **_law(t)}
            for label, t in sorted(case.tissues.items())
            if (model.mesh.tissue == label).any()
        },
        "assumptions": list(case.assumptions),
        "left_out": left_out(model),
        "remarks": [*case.remarks, *remarks_on_loads(case)],
    }


def describe_opening(
    case: Case, described: Mapping[str, Any], prior: FromPrior | None, system: System, precision: str
) -> dict[str, Any]:
    """How every summary of a run begins: what was computed, of which files, and where."""
    return {
        "case": described,
        "inputs_sha256": fingerprints(case, None if prior is None else prior.model),
        **({} if prior is None else {"prior": describe_prior(prior)}),
        "device": {"name": system.device.name, "alias": system.device.alias, "precision": precision},
    }


def _law(tissue: Tissue) -> dict[str, Any]:
    return {"parameters": vars(tissue.known_law), "shear_modulus_Pa": tissue.known_law.shear_modulus}


def describe_result(result: Result) -> dict[str, Any]:
    """Displacements by node set and extremes of strain and stress, with units."""
    return {
        "displacement_mm": {
            name: {"nodes": s.nodes, **sizes_mm(s)} for name, s in result.displacement_statistics().items()
        },
        "volume_ratio_J": _ends(result.J),
        "principal_stretch": _ends(result.principal_stretches),
        "von_mises_Pa": {"largest": result.von_mises.max()},
        "pressure_Pa": _ends(result.pressure),
        "reaction_N": result.reactions.sum(axis=0),
        "pressures_at_nodes_Pa": {name: _ends(values) for name, values in result.nodal_pressures.items()},
    }


def _ends(values: Any) -> dict[str, float]:
    return {"smallest": values.min(), "largest": values.max()}


def sizes_mm(statistics: Any) -> dict[str, float]:
    """Statistics of displacements in mm."""
    return {key: MILLIMETRES * getattr(statistics, key) for key in _SIZES}


def displacement_rows(described: Mapping[str, Any]) -> list[list[Any]]:
    """Node set, number of nodes, mean, root mean square, 95th percentile and largest displacement [mm], as text."""
    sets = described["displacement_mm"].items()
    return [[SET_TITLES.get(name, name), s["nodes"], *(tabled(s[key]) for key in _SIZES)] for name, s in sets]


def describe_prior(prior: FromPrior) -> dict[str, Any]:
    """Model, draw and laws, with units; the draw is None where the laws are those of middle curves."""
    drawn, draw = prior.drawn, None
    each = {str(label): prior.case.tissues[label] for label in prior.labels}
    tissues = {k: {"name": t.name, "group": t.prior, "law": t.known_law.name, **_law(t)} for k, t in each.items()}
    if drawn is not None:
        draw = {"sample": drawn.number, "seed": drawn.seed, "redrawn": len(drawn.rejected), "reasons": drawn.rejected}
        for described, fitted in zip(tissues.values(), drawn.fits, strict=True):
            described["rms_of_fit"] = fitted.rms
    return {**describe_model(prior.model), "draw": draw, "tissues": tissues}


def describe_model(model: Process) -> dict[str, Any]:
    """Which generative model it is, and the folder of one that does not ship."""
    folder = None if model.folder is None else str(model.folder)
    return {"model": model.name, "variant": model.variant, "folder": folder}


def show_lines(case: Case) -> list[str]:
    """Everything a case says, as printed."""
    return lines("case.txt", "show", case, measure(case.mesh), SET_TITLES, STAND_IN)
