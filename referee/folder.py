"""The case folder of a truth: what the tool is told, and nothing else."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from referee.geometry import declared_case, declared_mesh
from referee.observe import CAP, recordings
from referee.setting import DOWN
from referee.truth import Truth
from warpbrain.cases.boundary import Boundary, Displaced, Fixed, Forced
from warpbrain.cases.writing import write_case


def write_folder(folder: Path, name: str, truth: Truth) -> None:
    """Write what a case declares of a truth.

    Parameters
    ----------
    folder : Path
        Made anew.
    name : str
        Of the case; says nothing of what acts in it.
    truth : Truth
    """
    setting = truth.setting
    load: Boundary
    if setting.total is not None:
        load = Forced(name=CAP, nodes="superior", total=setting.total)
    else:
        assert setting.moved is not None
        load = Displaced(name=CAP, nodes="superior", times=(0.0,), values=(setting.moved,))
    case = replace(
        declared_case(setting.geometry),
        name=name,
        title=f"Made by the referee: {name}",
        origin="synthetic",
        mesh=declared_mesh(setting.mesh),
        mesh_file="mesh.vtu",
        gravity_axis=DOWN,
        boundaries=(Fixed(name="skull base", nodes="fixed"), Fixed(name="side", nodes="side"), load),
        mechanisms=(),
        recordings=recordings(truth),
        remarks=(),
    )
    write_case(folder, case)
