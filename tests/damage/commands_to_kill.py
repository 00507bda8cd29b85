"""The commands that are killed, each with a small case that it ends within seconds."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from unittest.mock import patch

from folders import block, write_recorded
from not_drawn import nothing_drawn
from sinking_block import write_sinking
from synthetic import WHITE, beads, truth
from synthetic import block as layered

from warpbrain.cases.writing import write_case

_GREY, _WHITE = (f"hyperelastic/{anatomy}" for anatomy in ("grey matter", "white matter"))
_PRIORS = (
    ("mu = 1000.0", f'mu = 1000.0\nprior = "{_GREY}"'),
    ("mu = 3000.0", f'mu = 3000.0\nprior = "{_WHITE}"'),
    ("total = [0.01, 0.02, -0.05]", "total = [0.001, 0.002, -0.005]"),
)


@dataclass(frozen=True)
class Command:
    """A command.

    Attributes
    ----------
    name : str
    arguments : tuple of str
        Without the folder of its results.
    others : tuple of str
        Arguments of another one, whose results it is to replace; none if it goes on with what is there.
    told_of : tuple of str
        Files that are there, and of the same command, where the file is that says what the results are.
    goes_on_with : tuple of str
        Of these files, those that are there from the beginning.
    """

    name: str
    arguments: tuple[str, ...]
    others: tuple[str, ...] = ()
    told_of: tuple[str, ...] = ()
    goes_on_with: tuple[str, ...] = ()

    @contextmanager
    def prepared(self) -> Iterator[None]:
        """Bodies are not rendered and curves not drawn, which take most of the time; meshes built are blocks."""
        with ExitStack() as stack:
            stack.enter_context(nothing_drawn())
            for target, stand_in in _BUILDING if self.name == "cases build" else ():
                stack.enter_context(patch(target, stand_in))
            yield


def commands(place: Path) -> list[Command]:
    """Write the cases to a folder; returns the commands."""
    pressed = str(write_recorded(place / "pressed"))
    drawn = str(write_recorded(place / "drawn", *_PRIORS))
    write_sinking(place / "sinking")
    case = layered({"brain": WHITE}, "pushed")
    write_case(place / "layered", replace(case, recordings=(replace(beads(truth(case), noise=1e-4), file="b.csv"),)))
    few = ("--samples", "25", "--no-causes", "--no-discretisation", "--quiet")
    looked = ("--candidates", "gravity,pressure", "--no-discretisation", "--quiet")
    cpu = ("--device", "cpu", "--quiet")
    return [
        Command(
            "run", ("run", *cpu, "--case", pressed), ("run", *cpu, "--case", pressed, "--mu", "500"),
            ("result.vtu", "comparison.csv"),
        ),
        Command(
            "ensemble", ("ensemble", *cpu, "--case", drawn, "--samples", "6", "--steps", "3", "--processes", "1",
                         "--batch", "2"),
            told_of=("samples.csv",), goes_on_with=("ensemble.json",),
        ),
        Command(
            "estimate", ("estimate", "--device", "cpu", "--case", str(place / "layered"), *few),
            ("estimate", "--device", "cpu", "--case", str(place / "layered"), *few, "--seed", "1"),
            ("predictions.csv", "state.vtu"),
        ),
        Command(
            "sweep", ("estimate", "--method", "grid", "--case", str(place / "layered"), *cpu),
            goes_on_with=("sweep.csv",),
        ),
        Command(
            "diagnose", ("diagnose", "--device", "cpu", "--case", str(place / "sinking"), *looked),
            ("diagnose", "--device", "cpu", "--case", str(place / "sinking"), *looked, "--ablation", "no-nuisances"),
            ("map.vtu", "state.vtu", "points.csv"),
        ),
        Command("cases build", ("cases", "build", "phantom"), told_of=()),
    ]  # fmt: skip


def _nothing(*_values: object, **_named: object) -> None:
    return None


def _examples(mesh: object) -> object:
    return mesh


_PIPELINE = "warpbrain.cases.building.pipeline."
#: What needs the extra `build`, too: what is killed is the writing.
_BUILDING: tuple[tuple[str, Callable[..., object]], ...] = (
    *((_PIPELINE + name, _nothing) for name in ("template_anatomy", "discretise", "fit_size")),
    (_PIPELINE + "remesh", lambda _cells, _edge: block()),
    (_PIPELINE + "require_extra", _nothing),
    (_PIPELINE + "versions", dict),
    (_PIPELINE + "named_mesh", lambda _cells, _recipe: block()),
    (_PIPELINE + "with_example_sets", _examples),
)
