"""The text of a new `case.toml`: what is needed to run, and what its user may want to add."""

from __future__ import annotations

import json
from collections.abc import Mapping

#: Shear modulus [Pa] of tissues that are not named, between those of grey and white matter.
OTHER_MU = 1200.0
#: Of brain [kg/m3]: ICRU Report 44 (1989), Tissue substitutes in radiation dosimetry and measurement. The
#: paper's 1211.5 kg/m3, which the shipped cases have, are of its own table.
DENSITY = 1040.0
#: Shear moduli [Pa] of the shipped cases, the paper's reference for its multi-tissue phantom.
MU = {"grey matter": 1370.0, "white matter": 1000.0}

_TEXT = """\
# Made by `warpbrain cases new` from {source}. Check it with `warpbrain cases check`.
# Every key is explained in docs/case-format.md; docs/your-data.md goes from here to a run.

[case]
name = {name}
title = {name}
origin = "measured"            # "measured" | "stand-in" | "synthetic"
units = "mm"                   # of every length in the files of this folder
axes = "RAS"                   # of every position in them: x right, y to the front, z up; or "LPS"
# gravity_axis = [0, -1, 0]    # where 'down' was while recording; this is a patient who lies on the back
# registration = {{ mm = 1.0, degrees = 1.0 }}  # accuracy of recordings against the anatomy, one standard deviation

[mesh]
file = "mesh.vtu"

# Shear moduli are starting values, not measurements of this brain: grey and white matter as in the shipped cases
# (docs/anatomy.md), {other:g} Pa for anything else.
{tissues}
[body]
density = {density:g}                 # kg/m3, of brain (ICRU Report 44, 1989)
poisson = 0.45

# What is ASSUMED to act. What is not written here is not assumed.
# CHECK THIS ONE: `base` is only a first guess of where the skull base holds the brain: the outer nodes that face down
# in the lower third. Look at it with `warpbrain cases show`; any node set of the mesh can take its place.
[[boundary]]
name = "skull base"
nodes = "base"
kind = "fixed"

# A push of 1 N in all, to the left, on every node of a set:
# [[boundary]]
# name = "push"
# nodes = "{pushed}"
# kind = "force"
# total = [-1, 0, 0]

# The brain sags because fluid has drained (needs gravity_axis above):
# [[mechanism]]
# kind = "gravity"
# csf_level = 60.0             # how high the fluid still stands, in mm above the lowest point of the brain

# Tissue that was taken out: the element set `set_resection` of the mesh.
{mark}[[mechanism]]
{mark}kind = "resection"
{mark}elements = "resection"

# What was observed: landmarks and where they went.
# [[recording]]
# name = "landmarks"
# kind = "points"
# file = "recordings/landmarks.csv"   # columns x,y,z,ux,uy,uz in units and axes of this case
# sigma = 0.5                  # noise of one component, one standard deviation, in units
# role = "fit"                 # "fit" | "check": a "check" recording is never fitted, only scored
"""


def case_text(name: str, source: str, tissues: Mapping[int, str], cavities: bool, resected: bool = False) -> str:
    """Text of a `case.toml` that can be run as it is, of a mesh that was made from the file `source`: names of its
    tissues by number, whether it has the node set `ventricle`, and the element set `resection`, which is then taken
    out."""
    return _TEXT.format(
        name=quoted(name),
        source=quoted(source),
        other=OTHER_MU,
        density=DENSITY,
        tissues="".join(_tissue(number, tissue) for number, tissue in tissues.items()),
        mark="" if resected else "# ",
        pushed="ventricle" if cavities else "surface",
    )


def quoted(text: str) -> str:
    """A string as TOML writes it: as JSON does, but for one control character that JSON leaves alone."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _tissue(number: int, name: str) -> str:
    prior = f'prior = "hyperelastic/{name}"\n' if name in MU else ""
    return (
        f"[tissue.{number}]\nname = {quoted(name)}\n"
        'model = "neo-hookean"          # "neo-hookean" | "mooney-rivlin" | "ogden", see docs/laws.md\n'
        f"mu = {MU.get(name, OTHER_MU):.1f}{' ' * 20}# shear modulus, Pa\n{prior}\n"
    )
