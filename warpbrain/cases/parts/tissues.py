"""The tissues of a case: a law for every label of its mesh."""

import re

from warpbrain.cases.case import Tissue
from warpbrain.cases.format.reading import Context, Reading
from warpbrain.cases.format.tables import BODY, PRIOR, TISSUE
from warpbrain.errors import InputError
from warpbrain.gp.literature.study import GROUPS
from warpbrain.keys import short
from warpbrain.physics.laws import LAWS

#: Shear modulus [Pa] of tissues that are not named, between those of grey and white matter.
OTHER_MU = 1200.0
#: Of brain [kg/m3]: ICRU Report 44 (1989), Tissue substitutes in radiation dosimetry and measurement. The
#: paper's 1211.5 kg/m3, which the shipped cases have, are of its own table.
DENSITY = 1040.0
#: Densities [kg/m3] that a tissue, gel or foam can have: wide, and too narrow for g/cm3.
LIGHTEST, HEAVIEST = 20.0, 30000.0


def read_tissues(context: Context) -> dict[int, Tissue]:
    """Tissues by label, as far as they are right."""
    values = context.tables.get("tissue")
    if values is None:
        context.problem("[tissue]", "missing", "one table [tissue.LABEL] for each label of the mesh")
        return {}
    if not isinstance(values, dict):
        context.problem("[tissue]", f"expected a table, found {short(values)}")
        return {}
    tissues: dict[int, Tissue] = {}
    labels: set[int] = set()
    for key, value in values.items():
        if not re.fullmatch("0|[1-9][0-9]{0,9}", key):
            message = " ".join(f"tissue labels are whole numbers, found '{key}'".split())
            context.problem(f"[tissue.{key}]", message, "[tissue.1]")
            continue
        labels.add(int(key))
        tissue = _read_tissue(Reading(TISSUE, value, context, f"tissue.{key}"), key)
        if tissue is not None:
            tissues[int(key)] = tissue
    if context.mesh is not None:
        there = set(context.mesh.labels)
        for label in sorted(there - labels):
            if label < 0:
                message = f"the mesh has tissue {label}, expected labels from 0"
                context.problem("[tissue]", message, "number the labels of the mesh anew")
                continue
            message = f"missing, but the mesh has tissue {label} ({(context.mesh.tissue == label).sum()} tetrahedra)"
            context.problem(f"[tissue.{label}]", message, "add the table")
        for label in sorted(labels - there):
            known = ", ".join(map(str, sorted(there)))
            context.problem(f"[tissue.{label}]", f"the mesh has no tissue {label}", f"it has {known}")
    return tissues


def _read_tissue(table: Reading, label: str) -> Tissue | None:
    if table.variant is None:
        return None
    kind, law = LAWS[table.variant], None
    if table.get("mu") == PRIOR:
        wrong = [key for key in kind.keys if key != "mu" and table.has(key)]
        for key in wrong:
            table.problem(key, f'means nothing with mu = "{PRIOR}", which gives the whole law')
        if not table.has("prior"):
            table.problem("prior", f'missing, but mu = "{PRIOR}" needs it', f"one of {', '.join(GROUPS)}")
            wrong.append("prior")
    else:
        wrong = [key for key in kind.keys if not table.has(key)]
        for key in wrong:
            if not table.named(key):
                table.problem(key, "missing", 'a modulus in Pa, or mu = "prior"' if key == "mu" else "")
        try:
            law = None if wrong else kind(**{key: table.si(key) for key in kind.keys})
        except InputError as error:
            table.context.problem(f"[{table.where}]", str(error))
            wrong = list(kind.keys)
    if table.has("accuracy") and table.has("prior"):
        table.problem("accuracy", "means nothing beside a prior, which says how well moduli are known", "leave one out")
        wrong.append("accuracy")
    if wrong:
        return None
    return Tissue(
        name=table.get("name") or f"tissue {label}",
        law=law,
        formulation=table.get("formulation"),
        prior=table.get("prior") or "",
        model=table.variant,
        accuracy=table.si("accuracy"),
    )


def read_body(context: Context) -> tuple[float, float, float | None]:
    """Density [kg/m3], Poisson ratio, and standard deviation of `ln mu` from place to place if it is declared."""
    table = context.table(BODY, needed=False)
    density = table.si("density")
    if not table.has("density") and "specimen" not in context.tables:
        context.problems.remark(
            context.file,
            f"[body] density: not given: the {density:g} kg/m3 of the paper's Table 4 are taken; brain has "
            f"{DENSITY:g} (ICRU Report 44, 1989)",
        )
    if not LIGHTEST < density < HEAVIEST:
        cure = f"{density:g} g/cm3 is {1000.0 * density:g} kg/m3" if density < LIGHTEST else "is it in kg/m3?"
        table.problem("density", f"found {density:g} kg/m3, which no tissue or gel has", cure)
    if table.has("heterogeneity") and "specimen" in context.tables:
        table.problem("heterogeneity", "means nothing with a [specimen], which is taken to be of one stiffness")
    return density, table.si("poisson"), table.si("heterogeneity")
