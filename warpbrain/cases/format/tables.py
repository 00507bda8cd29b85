"""Every table of `case.toml`. The page that users read is docs/case-format.md; the JSON Schema is made from this."""

from warpbrain.cases.boundary import BOUNDARIES, RAMP
from warpbrain.frame import AXES, METRES
from warpbrain.gp.literature.study import GROUPS
from warpbrain.keys import Key, Table
from warpbrain.physics.laws import FORMULATIONS, LAWS, Law
from warpbrain.physics.mechanism import Mechanism
from warpbrain.physics.mechanisms import mechanisms
from warpbrain.recordings.recording import RECORDINGS

#: What stands in the place of a shear modulus that the generative model is to give.
PRIOR = "prior"

CASE = Table(
    "case",
    "What the case is, and the units and axes of every file in its folder.",
    (
        Key("name", "text", "Short name; names the folder of results.", needed=True, hint='name = "my-case"'),
        Key("title", "text", "One line for people; the name if absent."),
        Key(
            "origin",
            "text",
            "Whether the recordings were measured, stand in for measured ones, or are synthetic.",
            needed=True,
            choices=("measured", "stand-in", "synthetic"),
            hint='origin = "measured", if it was',
        ),
        Key("units", "text", "Unit of all lengths in the folder", choices=tuple(METRES), default="mm"),
        Key("axes", "text", "Axes of all vectors in the folder", choices=tuple(AXES), default="RAS"),
        Key("gravity_axis", "vector", "Where 'down' was while recording, in the axes; unknown if absent."),
        Key(
            "registration",
            "table",
            "How well recordings are registered to the anatomy (one sd); 1 degree, in a brain 1 mm, if absent.",
            keys=(
                Key(
                    "mm",
                    "number",
                    "Of each component of the shift, whatever the units.",
                    "mm",
                    True,
                    above=0.0,
                    below=1e3,
                ),
                Key("degrees", "number", "Of the turn about each axis.", "degrees", True, above=0.0, below=360.0),
            ),
            hint="registration = { mm = 2.0, degrees = 1.0 }",
        ),
    ),
)

MESH = Table(
    "mesh",
    "The anatomy.",
    (
        Key("file", "file", "Volume mesh that meshio reads.", needed=True, hint='file = "mesh.vtu"'),
        Key("tissue", "text", "Cell array of tissue labels; absent: 'tissue' if there, else one tissue."),
    ),
)


def _law_keys(law: type[Law]) -> tuple[Key, ...]:
    """Keys of a law; mu = "prior" has a meaning for every law."""
    by_model = f'"{PRIOR}": the generative model gives the law.'
    mu = Key("mu", "text", f"Only {by_model}", choices=(PRIOR,), hint=f"{law.name} takes {', '.join(law.keys)}")
    keys = {"mu": mu} if "mu" not in law.keys else {}
    for name, key in law.keys.items():
        kind, prior = "numbers" if key.several else "number", name == "mu"
        text = f"{key.text} Or {by_model}" if prior else key.text
        kinds, choices = (f"{kind}|text", (PRIOR,)) if prior else (kind, ())
        keys[name] = Key(name, kinds, text, key.unit, choices=choices)
    return tuple(keys.values())


TISSUE = Table(
    "tissue",
    "A tissue, by its label in the mesh: [tissue.1], [tissue.2], ...",
    (
        Key("name", "text", "For people."),
        Key("formulation", "text", "How the law treats changes of volume", choices=FORMULATIONS, default="coupled"),
        Key("prior", "text", "Group of the generative model.", choices=GROUPS),
        Key(
            "accuracy",
            "number",
            "Relative standard deviation of its modulus, where that was measured; without a prior 0.5 if absent.",
            above=0.0,
            below=3.0,
        ),
    ),
    by=Key("model", "text", "Law", choices=tuple(LAWS), default="neo-hookean"),
    variants={name: _law_keys(law) for name, law in LAWS.items()},
)

BODY = Table(
    "body",
    "What all tissues share.",
    (
        # wide enough for foams and metals, too narrow for g/cm3
        Key("density", "number", "1211.5 (the paper's Table 4) if absent.", "kg/m3", above=0.0, default=1211.5),
        Key("poisson", "number", "Poisson ratio at rest", above=-1.0, below=0.5, default=0.45),
        Key(
            "heterogeneity",
            "number",
            "Standard deviation of ln(modulus) from place to place within a tissue; that of brain if absent.",
            above=0.0,
            below=3.0,
        ),
    ),
)

BOUNDARY = Table(
    "boundary",
    "What is assumed to act on a set of nodes.",
    (
        Key("name", "text", "For people, and for recordings of force; the node set's name if absent."),
        Key(
            "nodes",
            "text",
            "Point array of the mesh (non-zero: member), or a .csv of node ids in this folder.",
            needed=True,
        ),
    ),
    by=Key("kind", "text", "What is assumed.", needed=True, choices=tuple(BOUNDARIES)),
    variants={kind: boundary.keys for kind, boundary in BOUNDARIES.items()},
    several=True,
)

#: What a parameter of a mechanism is in a file, where that has another name.
_KIND = {"node set": "text", "element set": "text", "directions": "text", "surface": "file", "position": "vector"}


def _mechanism_keys(mechanism: type[Mechanism]) -> tuple[Key, ...]:
    keys = []
    for name, spec in mechanism.parameters().items():
        unit = "units" if spec.kind == "position" else spec.unit
        kind, needed = _KIND.get(spec.kind, spec.kind), name in mechanism.required()
        limits = (spec.above, spec.below)
        keys.append(Key(name, kind, mechanism.described(name), unit, needed, spec.choices, *limits, si=spec.si))
    return (*keys, RAMP)


MECHANISM = Table(
    "mechanism",
    "Further physics that is assumed to act.",
    by=Key("kind", "text", "Its name.", needed=True, choices=tuple(mechanisms())),
    variants={kind: _mechanism_keys(mechanism) for kind, mechanism in mechanisms().items()},
    several=True,
)

RECORDING = Table(
    "recording",
    "What was observed.",
    (
        Key("name", "text", "For people.", needed=True),
        Key("file", "file", "Its file in this folder.", needed=True),
        Key("role", "text", "A check recording is never fitted, only scored", choices=("fit", "check"), default="fit"),
        Key(
            "sigma",
            "number",
            "Noise of one component, one standard deviation, in the unit of what was recorded; estimated if absent.",
            "units, N, Pa or N m",
            above=0.0,
        ),
    ),
    by=Key("kind", "text", "What it holds.", needed=True, choices=tuple(RECORDINGS)),
    variants={kind: recording.keys for kind, recording in RECORDINGS.items()},
    several=True,
)

SPECIMEN = Table(
    "specimen",
    "A laboratory specimen, in the place of [mesh]: its shape is given and meshed.",
    (Key("grips", "text", "How its ends are held.", needed=True, choices=("glued", "lubricated")),),
    by=Key("shape", "text", "Its shape.", needed=True, choices=("cylinder", "block")),
    variants={
        "cylinder": (
            Key("radius", "number", "Its axis is z.", "units", needed=True, above=0.0),
            Key("height", "number", "Along z.", "units", needed=True, above=0.0),
        ),
        "block": (Key("size", "vector", "Along x, y and z.", "units", needed=True),),
    },
)

TABLES = (CASE, MESH, SPECIMEN, TISSUE, BODY, BOUNDARY, MECHANISM, RECORDING)
