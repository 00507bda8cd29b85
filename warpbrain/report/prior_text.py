"""Laws that came from the generative model: what a run prints of them, and their JSON."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from warpbrain.cases.drawn import FromPrior


def describe_prior(found: FromPrior) -> dict[str, Any]:
    """Model, draw and laws, with units; the draw is None where the laws are those of middle curves."""
    drawn = found.drawn
    draw: dict[str, Any] | None = None
    tissues: dict[str, dict[str, Any]] = {}
    for label in found.labels:
        tissue = found.case.tissues[label]
        tissues[str(label)] = {
            "name": tissue.name,
            "group": tissue.prior,
            "law": tissue.known_law.name,
            "parameters": vars(tissue.known_law),
            "shear_modulus_Pa": tissue.known_law.shear_modulus,
        }
    if drawn is not None:
        draw = {"sample": drawn.number, "seed": drawn.seed, "redrawn": len(drawn.rejected), "reasons": drawn.rejected}
        for described, fitted in zip(tissues.values(), drawn.fits, strict=True):
            described["rms_of_fit"] = fitted.rms
    return {"model": found.model.name, "variant": found.model.variant, "draw": draw, "tissues": tissues}


def prior_lines(described: Mapping[str, Any] | None) -> list[str]:
    """What is printed; nothing for None, where no law is the generative model's."""
    if described is None:
        return []
    draw = described["draw"]
    by = f"the generative model {described['model']} ({described['variant']})"
    lines, curve = [], f"the middle curve of {by}"
    if draw is not None:
        curve = "drawn"
        lines = [
            f"  prior     draw {draw['sample']} of seed {draw['seed']} by {by}; unstable and redrawn: {draw['redrawn']}"
        ]
        lines += [f"  redrawn   {reason}" for reason in draw["reasons"]]
    for label, tissue in described["tissues"].items():
        lines.append(
            f"  tissue {label}  {tissue['group']}, {curve}: {tissue['law']}, {_parameters(tissue['parameters'])}, "
            f"shear modulus {tissue['shear_modulus_Pa']:.6g} Pa"
        )
    return lines


def _parameters(values: Mapping[str, float | tuple[float, ...]]) -> str:
    """As `C1 = 250 Pa, C2 = 3.1 Pa`: exponents have no unit."""
    said = []
    for name, value in values.items():
        number = ", ".join(f"{v:.6g}" for v in (value if isinstance(value, tuple) else (value,)))
        said.append(f"{name} = {number}" + ("" if name == "alpha" else " Pa"))
    return ", ".join(said)
