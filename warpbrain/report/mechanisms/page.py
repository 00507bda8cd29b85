"""The page of a mechanism."""

from __future__ import annotations

import sys

from warpbrain.physics.continuous import smooth_parameters
from warpbrain.physics.load import Load
from warpbrain.physics.mechanism import Following, Mechanism
from warpbrain.physics.mechanisms import mechanisms
from warpbrain.report.mechanisms.effect import Effect
from warpbrain.report.mechanisms.picture import MAGNIFIED, PLACE


def page(kind: str, effect: Effect) -> str:
    """The whole page.

    Parameters
    ----------
    kind : str
    effect : Effect
        Of its example.
    """
    mechanism = mechanisms()[kind]
    module = sys.modules[mechanism.__module__]
    source = f"../../{module.__name__.replace('.', '/')}.py"
    doc = (module.__doc__ or "").strip().splitlines()
    lines = [f"# {kind}", "", f"*{mechanism.sentence}* {doc[0]}", "", *_parameters(mechanism), ""]
    lines += [*_picture(mechanism, effect), "", *confusions(mechanism), *derivatives(mechanism), ""]
    lines += [f"[{source.rsplit('/', 1)[1]}]({source}), [cost](index.md#cost), [together with others](pairs.md)", ""]
    if len(doc) > 1:
        # the equations stand once, at the head of the file that computes them
        lines += [f"```{{docstring}} {module.__name__}", "```", ""]
    return "\n".join(lines)


def confusions(mechanism: type[Mechanism]) -> list[str]:
    """What has nearly the same effect, and what tells them apart."""
    known = mechanisms()
    others = [f"[{kind}]({kind}.md)" if kind in known else kind for kind in mechanism.confused_with]
    lines = [f"Taken for {', '.join(others)}." if others else "Nothing else has nearly the same effect."]
    if mechanism.of_specimens:
        lines.append("It acts in specimens too.")
    if issubclass(mechanism, Load | Following) and not mechanism.quadratic:
        lines.append("It does not act on elements `tet10` and `tet10-mixed`.")
    if mechanism.needs:
        return [*lines, f"Told apart by {', '.join(mechanism.needs)}."]
    return lines


def derivatives(mechanism: type[Mechanism]) -> list[str]:
    """How a state is differentiated by its parameters: by differences along the way, or not, where one switches."""
    lines = []
    numbers = [f"`{key}`" for key in smooth_parameters(mechanism)]
    if numbers:
        lines.append(f"[Derivatives](../solvers.md#derivatives) by {', '.join(numbers)}.")
    for key, says in mechanism.parameters().items():
        if says.choices:
            lines.append(f"`{key}` is one of {', '.join(says.choices)}: a secant, not a derivative.")
    if mechanism.switches:
        lines.append("It is there or not: a secant, not a derivative.")
    return lines


def _parameters(mechanism: type[Mechanism]) -> list[str]:
    lines = []
    for name, says in mechanism.parameters().items():
        unit = "`units`" if says.kind == "position" else says.unit
        parts = [f"- `{name}`{f' [{unit}]' if unit else ''}: {mechanism.described(name)}"]
        if says.expectation is not None:
            parts.append(f"Expected: {says.expectation}.")
        if says.typical:
            parts.append(f"Typical: {says.typical}.")
        if says.source:
            parts.append(f"Source: {says.source}.")
        lines.append(" ".join(parts))
    return lines


def _picture(mechanism: type[Mechanism], effect: Effect) -> list[str]:
    state = f"{effect.steps} ms after the load came, from rest" if effect.steps else "in equilibrium"
    return [
        "```sh",
        f"warpbrain run {effect.command} --with {mechanism.example}",
        "```",
        "",
        f"![{mechanism.kind}: what it does to the phantom](../figures/mechanism-{mechanism.kind}.png)",
        "",
        f"Cut at y = {1000.0 * PLACE:.0f} mm. Right: what is added {state} ({MAGNIFIED:g} times), at most "
        f"{effect.largest:.2f} mm.",
    ]
