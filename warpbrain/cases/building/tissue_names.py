"""Which label is which tissue: what the user says with `--tissue`, what a program is known to write (`presets.toml`),
and what is done with what was not said.
"""

import re
import tomllib
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cache
from importlib.resources import files

from warpbrain.errors import InputError

#: Names that are no tissue: an open cavity inside the body, and what lies outside of it.
VENTRICLE = "ventricle"
OUTSIDE = ("ignore", "background")
NO_TISSUE = (VENTRICLE, *OUTSIDE)
#: Labels that become tissues of their own without being named; more need `--tissue`.
MOST_UNNAMED = 8
#: Tissues of one mesh.
MOST_TISSUES = 40
#: Name of tissue that was or is to be taken out.
RESECTION = "resection"
#: Labels that a message lists.
_LISTED = 60
_USUAL = dict.fromkeys(("grey", "gray", "grey matter", "gray matter"), "grey matter")
_USUAL |= {**dict.fromkeys(("white", "white matter"), "white matter"), RESECTION: RESECTION}
#: Names that the literature or other programs use; one that is nearly one of them was meant for it.
_KNOWN = (
    *("grey matter", "gray matter", "white matter", "grey", "gray", "white", "cerebellum", "brain stem", "brainstem"),
    *("thalamus", "hippocampus", "lesion", "tumour", "tumor", "oedema", "edema", RESECTION, "brain"),
)
#: From which likeness on a name is taken for a misspelt one.
_LIKE = 0.75
_NAME = re.compile(r"[^\W_](?:[\w ().+/-]{0,58}[\w)])?")


@dataclass(frozen=True)
class Assignment:
    """What labels are: names of tissues by their number, which is the first label that was given the name; the number
    of its tissue for every label that is tissue; labels of open cavities; labels outside the body."""

    tissues: Mapping[int, str]
    number: Mapping[int, int]
    cavity: tuple[int, ...] = ()
    outside: tuple[int, ...] = ()


def parse_names(arguments: Sequence[str], there: Collection[int] | None = None) -> dict[int, str]:
    """Names by label, from arguments such as ``"2=grey,1000-2035=grey"``, in the order given.

    A range names the labels in it that are `there`; without these it is checked only. `InputError` for anything that is
    not LABEL=NAME or FIRST-LAST=NAME, a label named twice, a range in which there is no label, and a name that could be
    meant in two ways.
    """
    names: dict[int, str] = {}
    for pair in (piece.strip() for argument in arguments for piece in argument.split(",")):
        labels, equals, name = (part.strip() for part in pair.partition("="))
        if not equals or not (ends := re.fullmatch("([0-9]{1,9})(?:-([0-9]{1,9}))?", labels)):
            raise InputError(f"--tissue: expected LABEL=NAME pairs such as 2=grey,3=white, found '{pair}'")
        first, last = int(ends[1]), int(ends[2] or ends[1])
        if first == 0:
            raise InputError("--tissue: label 0 is always outside the body, it cannot be named")
        if last < first:
            raise InputError(f"--tissue: {labels}={name}: the range ends before it begins")
        usual = usual_name(name)
        named = [first] if ends[2] is None else sorted(n for n in there or () if first <= n <= last)
        if there is not None and not named:
            raise InputError(f"--tissue: there is no label in {labels}, but {', '.join(map(str, sorted(there)))}")
        for number in named:
            if number in names:
                raise InputError(f"--tissue: label {number} is named twice, '{names[number]}' and '{name}'")
            names[number] = usual
    return names


def usual_name(name: str) -> str:
    """The name in the form that is used throughout: ``"gray"`` and ``"GREY_MATTER"`` are ``"grey matter"``."""
    low = " ".join(re.split(r"[\s_-]+", name.lower().strip(" _-")))
    if low in NO_TISSUE:
        return low
    # a misspelt cavity would be meshed as a solid
    if re.search("ventric|csf|fluid", low):
        raise InputError(
            f"--tissue: '{name}' could be inside or outside the brain: write {VENTRICLE} (an open cavity inside, not "
            f"meshed) or {OUTSIDE[0]} (outside, not meshed)"
        )
    if not _NAME.fullmatch(name):
        raise InputError(f"--tissue: '{name}' cannot be the name of a tissue: use letters, digits, spaces and ().+/-")
    known = (*_KNOWN, *OUTSIDE)
    # a number after a name, as in 'lesion 2', makes it no other word
    word = re.sub(r"[\W\d_]+$", "", low)
    if word not in known and (near := get_close_matches(word, known, 1, _LIKE)):
        raise InputError(f"--tissue: '{name}': did you mean {_USUAL.get(near[0], near[0])}?")
    return _USUAL.get(low, name)


def assign(volumes: Mapping[int, float], names: Mapping[int, str], others: str | None) -> Assignment:
    """Decide what every label is, by the volume [mm3] of each there is.

    Without names every label becomes a tissue of its own; `others` is the name of every label that `names` leaves out.
    `InputError` if a name was given to a label that is not there, a label is left without one, or there is no tissue.
    """
    if absent := [label for label in names if label not in volumes]:
        none, some = (", ".join(map(str, labels)) for labels in (absent, sorted(volumes)))
        raise InputError(f"--tissue: the volume has no label {none}; it has {some}")
    complete = dict(names)
    left = [label for label in volumes if label not in names]
    if others is not None:
        complete |= dict.fromkeys(left, usual_name(others))
    elif not names and len(left) <= MOST_UNNAMED:
        complete = {label: f"tissue {label}" for label in left}
    elif left:
        unnamed = "that --tissue does not name" if names else "and --tissue does not say which tissue each is"
        shown = ", ".join(f"{label} ({volumes[label] / 1000:.3g} cm3)" for label in left[:_LISTED])
        more = f" and {len(left) - _LISTED} more" if len(left) > _LISTED else ""
        largest = zip(sorted(left, key=lambda label: -volumes[label]), ("grey", "white", VENTRICLE), strict=False)
        raise InputError(
            f"the volume has {len(left)} labels {unnamed}: {shown}{more}. For example --tissue "
            f"{','.join(f'{label}={name}' for label, name in largest)}; --others ignore leaves out what --tissue does "
            "not name"
        )
    number: dict[str, int] = {}
    for label, name in complete.items():
        number.setdefault(name, label)
    tissues = {n: name for name, n in sorted(number.items(), key=lambda pair: pair[1]) if name not in NO_TISSUE}
    if not tissues:
        raise InputError("--tissue: no label is left that is a tissue")
    if len(tissues) > MOST_TISSUES:
        raise InputError(f"--tissue: {len(tissues)} tissues are more than {MOST_TISSUES}: give several labels one name")
    return Assignment(
        tissues,
        {label: number[name] for label, name in complete.items() if name not in NO_TISSUE},
        tuple(label for label, name in complete.items() if name == VENTRICLE),
        tuple(label for label, name in complete.items() if name in OUTSIDE),
    )


@dataclass(frozen=True)
class Preset:
    """What the labels of a program are, by number, and which can mean something else: that the user must say."""

    names: dict[int, str]
    unsure: dict[int, str]


@cache
def presets() -> dict[str, Preset]:
    """What labels are by the names of the programs that write them: the tables of `presets.toml`."""
    text = (files("warpbrain.cases.building") / "presets.toml").read_text(encoding="utf-8")
    made: dict[str, Preset] = {}
    for program, table in tomllib.loads(text).items():
        unsure = {int(label): meaning for label, meaning in table.pop("unsure", {}).items()}
        del table["source"]
        names: dict[int, str] = {}
        for tissue, labels in table.items():
            for label in labels:
                first, _, last = str(label).partition("-")
                names |= dict.fromkeys(range(int(first), int(last or first) + 1), tissue)
        made[program] = Preset(names, unsure)
    return made


def preset(name: str) -> Preset:
    """The labels of a program; `InputError` if there is no preset of that name."""
    if name not in presets():
        raise InputError(f"--preset: found '{name}', expected one of {', '.join(presets())}")
    return presets()[name]
