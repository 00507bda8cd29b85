"""Every table of `case.toml`. The page that users read is docs/case-format.md; the JSON Schema is made from this."""

from __future__ import annotations

from warpbrain.cases.format.keys import Key, Table
from warpbrain.frame import AXES, METRES, PASCALS
from warpbrain.physics.laws import FORMULATIONS, LAWS
from warpbrain.physics.mechanism import Mechanism
from warpbrain.physics.mechanisms import mechanisms

ORIGINS = ("measured", "stand-in", "synthetic")
ROLES = ("fit", "check")
MODES = ("axial", "shear", "torsion", "confined", "biaxial")
GRIPS = ("glued", "lubricated")
STRESSES = ("nominal", "cauchy")
CONTROLS = ("displacement", "force")

#: Groups of the generative model: method and anatomy of the published strain-energy functions.
PRIOR_GROUPS = tuple(
    f"{method}/{anatomy}"
    for method in ("MRE", "linear", "hyperelastic")
    for anatomy in ("grey matter", "white matter", "brain", "abnormal")
)

CASE = Table(
    "case",
    "What the case is, and the units and axes of every file in its folder.",
    (
        Key("name", ("text",), "Short name; names the folder of results.", needed=True, hint='name = "my-case"'),
        Key("title", ("text",), "One line for people; the name if absent."),
        Key(
            "origin",
            ("text",),
            "Whether the recordings were measured, stand in for measured ones, or are synthetic.",
            needed=True,
            choices=ORIGINS,
            hint='origin = "measured", if it was',
        ),
        Key("units", ("text",), "Unit of all lengths in the folder; mm if absent.", choices=tuple(METRES)),
        Key("axes", ("text",), "Axes of all vectors in the folder; RAS if absent.", choices=tuple(AXES)),
        Key("gravity_axis", ("vector",), "Where 'down' was while recording, in the axes; unknown if absent."),
        Key(
            "registration",
            ("table",),
            "How well recordings are registered to the anatomy, one standard deviation; 1 mm and 1 degree if absent.",
            keys=(
                Key("mm", ("number",), "Of each component of the shift, whatever the units.", "mm", True, above=0.0),
                Key("degrees", ("number",), "Of the turn about each axis.", "degrees", True, above=0.0),
            ),
            hint="registration = { mm = 2.0, degrees = 1.0 }",
        ),
    ),
)

MESH = Table(
    "mesh",
    "The anatomy.",
    (
        Key("file", ("file",), "Volume mesh that meshio reads.", needed=True, hint='file = "mesh.vtu"'),
        Key(
            "tissue",
            ("text",),
            "Cell array of tissue labels; absent: 'tissue' if there, else one tissue.",
        ),
    ),
)

# one key may mean several things: a law's mu is a number, a list of numbers or "prior"
_LAW_KEYS = {
    "mu": 'Shear modulus (a list for Ogden\'s terms), or "prior": the generative model gives it.',
    "C1": "First Mooney-Rivlin modulus.",
    "C2": "Second Mooney-Rivlin modulus.",
    "alpha": "Exponents of Ogden's terms.",
}
#: What stands in the place of a shear modulus that the generative model is to give.
PRIOR = "prior"


def _law_key(name: str, kind: type) -> Key:
    unit = "" if name == "alpha" else "Pa"
    kinds = ("numbers",) if kind is list else ("number",)
    if name == "mu":
        return Key(name, (*kinds, "text"), _LAW_KEYS[name], unit=unit, choices=(PRIOR,))
    return Key(name, kinds, _LAW_KEYS[name], unit=unit)


TISSUE = Table(
    "tissue",
    "A tissue, by its label in the mesh: [tissue.1], [tissue.2], ...",
    (
        Key("name", ("text",), "For people."),
        Key("formulation", ("text",), "How the law treats changes of volume; coupled if absent.", choices=FORMULATIONS),
        Key("prior", ("text",), "Group of the generative model.", choices=PRIOR_GROUPS),
        Key(
            "accuracy",
            ("number",),
            "Relative standard deviation of its modulus, where that was measured; without a prior 0.5 if absent.",
            above=0.0,
            below=3.0,
        ),
    ),
    by=Key("model", ("text",), "Law; neo-hookean if absent.", choices=tuple(LAWS)),
    default="neo-hookean",
    # mu = "prior" has a meaning for every law
    variants={
        name: tuple(_law_key(key, kind) for key, kind in ({"mu": float} | dict(law.keys)).items())
        if "mu" in law.keys
        else (
            Key(
                "mu",
                ("text",),
                'Only "prior": the generative model gives the law.',
                choices=(PRIOR,),
                hint=f"{name} takes {', '.join(law.keys)}",
            ),
            *(_law_key(key, kind) for key, kind in law.keys.items()),
        )
        for name, law in LAWS.items()
    },
)

BODY = Table(
    "body",
    "What all tissues share.",
    (
        # wide enough for foams and metals, too narrow for g/cm3
        Key(
            "density",
            ("number",),
            "1211.5 (the paper's Table 4) if absent.",
            unit="kg/m3",
            above=0.0,
        ),
        Key("poisson", ("number",), "Poisson ratio at rest; 0.45 if absent.", above=-1.0, below=0.5),
    ),
)

_RAMP = Key("ramp", ("pairs",), "Factor over time [s]; 1 throughout if absent.")

BOUNDARY = Table(
    "boundary",
    "What is assumed to act on a set of nodes.",
    (
        Key("name", ("text",), "For people, and for recordings of force; the node set's name if absent."),
        Key(
            "nodes",
            ("text",),
            "Point array of the mesh (non-zero: member), or a .csv of node ids in this folder.",
            needed=True,
        ),
    ),
    by=Key(
        "kind",
        ("text",),
        "What is assumed.",
        needed=True,
        choices=("fixed", "sliding", "displacement", "force", "pressure", "contact"),
    ),
    variants={
        "fixed": (),
        "sliding": (),
        "displacement": (
            Key(
                "value",
                ("vector", "file"),
                "Displacement, or a .csv of it over time with the columns t, ux, uy, uz.",
                unit="units",
                needed=True,
                hint="value = [x, y, z]",
            ),
            _RAMP,
        ),
        "force": (Key("total", ("vector",), "Total force, shared evenly by the nodes.", unit="N", needed=True), _RAMP),
        "pressure": (
            Key("value", ("number",), "Pressure on the faces of the nodes, positive pushes.", unit="Pa", needed=True),
            _RAMP,
        ),
        "contact": (
            Key("surface", ("file",), "Closed surface that the nodes cannot cross.", needed=True),
            Key("friction", ("number",), "Coefficient of friction; 0 if absent.", above=-1e-300),
        ),
    },
    several=True,
)

#: What a parameter of a mechanism is in a file.
_KIND = {
    "number": "number",
    "text": "text",
    "node set": "text",
    "element set": "text",
    "directions": "text",
    "surface": "file",
    "position": "vector",
    "vector": "vector",
    "numbers": "numbers",
}


def _mechanism_keys(mechanism: type[Mechanism]) -> tuple[Key, ...]:
    required = mechanism.required()
    keys = []
    for name, says in mechanism.parameters().items():
        doc = mechanism.described(name)
        unit = "units" if says.kind == "position" else says.unit
        keys.append(Key(name, (_KIND[says.kind],), doc, unit, name in required, says.choices, says.above, says.below))
    return (*keys, _RAMP)


MECHANISM = Table(
    "mechanism",
    "Further physics that is assumed to act.",
    by=Key("kind", ("text",), "Its name.", needed=True, choices=tuple(mechanisms())),
    variants={kind: _mechanism_keys(mechanism) for kind, mechanism in mechanisms().items()},
    several=True,
)

_SIGMA = Key(
    "sigma",
    ("number",),
    "Noise of one component, one standard deviation, in the unit of what was recorded; estimated if absent.",
    unit="units, N, Pa or N m",
    above=0.0,
)

_REFERENCE = Key(
    "reference",
    ("number",),
    "Time of the loaded state from which displacements and forces are counted; the body at rest if absent.",
    unit="s",
    above=0.0,
)

RECORDING = Table(
    "recording",
    "What was observed.",
    (
        Key("name", ("text",), "For people.", needed=True),
        Key("file", ("file",), "Its file in this folder.", needed=True),
        Key("role", ("text",), "A check recording is never fitted, only scored; fit if absent.", choices=ROLES),
        _SIGMA,
    ),
    by=Key("kind", ("text",), "What it holds.", needed=True, choices=("points", "surface", "force", "test")),
    variants={
        "points": (
            Key("moved", ("file",), "Where the points went, if the file is a Slicer markup."),
            Key(
                "outside",
                ("text",),
                "What a point outside the mesh is: an error, or observed at the nearest point; error if absent.",
                choices=("error", "nearest"),
            ),
            _REFERENCE,
        ),
        "surface": (Key("nodes", ("text",), "Node set whose faces are compared with it.", needed=True), _REFERENCE),
        "force": (Key("boundary", ("text",), "Name of the boundary that acts with it.", needed=True), _REFERENCE),
        "test": (
            Key("mode", ("text",), "How the specimen was loaded.", needed=True, choices=MODES),
            Key(
                "stress",
                ("text",),
                "What the column stress is: force over the area at rest, or over that of an incompressible specimen; "
                "nominal if absent.",
                choices=STRESSES,
            ),
            Key("unit", ("text",), "Unit of the column stress; Pa if absent.", choices=tuple(PASCALS)),
            Key(
                "control",
                ("text",),
                "What the machine imposed, a displacement (stretch, angle) or a force (stress, torque); sigma is of "
                "the other; displacement if absent.",
                choices=CONTROLS,
            ),
            Key("specimen", ("text",), "Which one was tested, where tests are of several of one shape."),
            Key("axis", ("vector",), "Direction of the tissue along the machine's axis z; z if absent."),
            Key(
                "sheared",
                ("vector",),
                "Direction of the tissue along the machine's x, in which it shears; x if absent.",
            ),
        ),
    },
    several=True,
)

SPECIMEN = Table(
    "specimen",
    "A laboratory specimen, in the place of [mesh]: its shape is given and meshed.",
    (Key("grips", ("text",), "How its ends are held.", needed=True, choices=GRIPS),),
    by=Key("shape", ("text",), "Its shape.", needed=True, choices=("cylinder", "block")),
    variants={
        "cylinder": (
            Key("radius", ("number",), "Its axis is z.", unit="units", needed=True, above=0.0),
            Key("height", ("number",), "Along z.", unit="units", needed=True, above=0.0),
        ),
        "block": (Key("size", ("vector",), "Along x, y and z.", unit="units", needed=True),),
    },
)

TABLES = (CASE, MESH, SPECIMEN, TISSUE, BODY, BOUNDARY, MECHANISM, RECORDING)
