"""A truth as plain data: everything that is needed to make it again, and back."""

from __future__ import annotations

import platform
from dataclasses import asdict, dataclass, fields
from importlib.metadata import version
from typing import Any

import numpy as np

from concealed.body import Floats
from concealed.draw import Drawn
from concealed.effect import Effect, plain
from concealed.observing import SIGMA, WALLS, Blur
from concealed.settling import DENSITY, ELEMENTS, IMAGED_DOWN
from concealed.support_effects import MisjudgedLevel, Slip, TurnedHead
from concealed.tissue import Tissue
from concealed.tissue_effects import Inclusion, Swelling
from concealed.trial import Trial
from concealed.truth_mesh import RECIPE, fingerprint
from concealed.wall_effects import CavityPressure, VentricularPressure, WallTraction
from warpbrain.mesh import TetMesh

FORMAT = 1
PACKAGES = ("warpbrain", "warp-lang", "numpy", "scipy", "mmgpy", "nilearn", "nibabel")
LIMITATIONS = (
    "Made by the authors of the tool, with the tool's own solver and quadratic tetrahedra on a finer mesh: not an "
    "independent code. Quasi-static; no meninges, vessels or contact; tissue isotropic and "
    "elastic; effects are drawn from a list that was written with the tool's mechanisms in mind; the anatomy is a "
    "deformed template. Targets are the published medians with a spread that was not published. Nothing here is a "
    "statement about a patient."
)
EFFECTS: dict[str, type[Effect]] = {
    kind.kind: kind
    for kind in (
        CavityPressure,
        VentricularPressure,
        WallTraction,
        Swelling,
        Inclusion,
        Slip,
        TurnedHead,
        MisjudgedLevel,
    )
}


@dataclass(frozen=True, kw_only=True)
class Truth:
    """A draw whose strengths have been found.

    Attributes
    ----------
    name : str
        Of the case.
    seed, attempt : int
        What it was drawn from.
    wanted : (float, float)
        Motion of ventricles and cavity [m] that the strengths were fitted to.
    drawn : Drawn
    strength : float
        Of the main effect, without sign, in its unit.
    level : float
        True level of the fluid [m].
    """

    name: str
    seed: int
    attempt: int
    wanted: tuple[float, float]
    drawn: Drawn
    strength: float
    level: float

    @property
    def declared_level(self) -> float:
        """Level of the fluid that `case.toml` declares [m], to the millimetre."""
        level = self.level
        for effect in self.drawn.others:
            level = effect.declared_level(level)
        return round(level, 3)


def write_truth(truth: Truth, trial: Trial, mesh: TetMesh) -> dict[str, Any]:
    """A truth as plain data, with the motion of the observed points as it was.

    Parameters
    ----------
    truth : Truth
    trial : Trial
        Of that truth, on its fine mesh.
    mesh : TetMesh
        That mesh, with the tissue that is resected.
    """
    exact = trial.exact(truth.strength, truth.level)
    points = trial.body.mesh.points
    return {
        "format": FORMAT,
        "case": truth.name,
        "seed": str(truth.seed),
        "attempt": truth.attempt,
        "wanted_rms_m": list(truth.wanted),
        "effects": [effect.written() for effect in trial.effects(truth.strength)],
        "csf_level_m": truth.level,
        "csf_level_declared_m": truth.declared_level,
        "gravity_imaged": list(IMAGED_DOWN),
        "density_kg_m3": DENSITY,
        "tissue": {**plain(asdict(truth.drawn.tissue)), "modulus_Pa": list(truth.drawn.tissue.moduli().values())},
        "law": "two-term Ogden, uncoupled, mu_p/alpha_p convention",
        "blur": plain(asdict(truth.drawn.blur)),
        "declared_sigma_m": SIGMA,
        "mesh": {**RECIPE, "made_nodes": len(mesh.points), "elements": ELEMENTS, "sha256": fingerprint(mesh)},
        "observed": {
            wall: {"point_m": _rounded(points[nodes]), "displacement_m": _rounded(u)}
            for wall, nodes, u in zip(WALLS, trial.nodes, exact, strict=True)
        },
        "versions": {
            **{
                package: version(package)
                for package in ("warpbrain", "warp-lang", "numpy", "scipy", "mmgpy", "nilearn")
            },
            "machine": f"{platform.system()} {platform.machine()}, Python {platform.python_version()}",
        },
        "limitations": LIMITATIONS,
    }


def read_truth(data: dict[str, Any]) -> Truth:
    """Back from plain data."""
    main, *others = (_effect(entry) for entry in data["effects"])
    tissue = {key: value for key, value in data["tissue"].items() if key != "modulus_Pa"}
    return Truth(
        name=data["case"],
        seed=int(data["seed"]),
        attempt=data["attempt"],
        wanted=tuple(data["wanted_rms_m"]),
        drawn=Drawn(
            main=main, others=tuple(others), tissue=Tissue(**_frozen(tissue)), blur=Blur(**_frozen(data["blur"]))
        ),
        strength=abs(main.strength),
        level=data["csf_level_m"],
    )


def _effect(entry: dict[str, Any]) -> Effect:
    kind = EFFECTS[entry["kind"]]
    names = {field.name for field in fields(kind)}
    return kind(**_frozen({key: value for key, value in entry.items() if key in names}))


def _frozen(values: dict[str, Any]) -> dict[str, Any]:
    return {key: tuple(value) if isinstance(value, list) else value for key, value in values.items()}


def _rounded(values: Floats) -> list[list[float]]:
    """To a nanometre."""
    return [[float(v) for v in row] for row in np.round(values, 9)]
