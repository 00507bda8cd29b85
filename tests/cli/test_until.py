"""`warpbrain run --until`: slow change, from end to end."""

import json

import numpy as np
import pytest
from command import run
from folders import write_folder

from warpbrain.mesh.vtu import read_vtu

FLUID = "drainage:permeability=1e-9,drained=top"


def result(out):
    return read_vtu(out / "result.vtu").point_data


def test_fluid_flows_away_until_the_skeleton_carries_the_load(tmp_path):
    folder = write_folder(tmp_path / "case")
    ran = run(folder, "--with", FLUID, "--until", "10", "--steps", "4", "--out", tmp_path / "early")
    assert (ran.status, ran.err) == (0, "")
    said = json.loads((tmp_path / "early" / "summary.json").read_text(encoding="utf-8"))
    assert said["solution"]["kind"] == "slow change"
    assert [line["time_s"] for line in said["solution"]["history"]] == pytest.approx([0.625, 2.5, 5.625, 10.0])
    pressure = result(tmp_path / "early")["fluid_pressure"]
    assert said["result"]["pressures_at_nodes_Pa"]["fluid_pressure"]["largest"] == pytest.approx(pressure.max())
    assert f"fluid pressure {pressure.min():.3g} to {pressure.max():.3g} Pa" in ran.out
    # 0.05 N on 9 cm2
    assert 1.0 < pressure.max() < 55.0
    assert run(folder, "--out", tmp_path / "dry").status == 0
    assert run(folder, "--with", FLUID, "--until", "1e8", "--steps", "4", "--out", tmp_path / "late").status == 0
    assert run(folder, "--with", FLUID, "--out", tmp_path / "drained").status == 0
    dry, early, late, drained = (
        result(tmp_path / name)["displacement"] for name in ("dry", "early", "late", "drained")
    )
    size = np.abs(dry).max()
    assert np.abs(drained - dry).max() < 1e-6 * size
    assert np.abs(late - dry).max() < 1e-6 * size
    assert np.abs(early - dry).max() > 0.005 * size


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["--until", "0"], "--until 0: expected a positive number of seconds"),
        (["--until", "inf"], "--until inf: expected a positive number of seconds"),
        (["--until", "5", "--to-rest"], "--until 5: means nothing with --to-rest"),
        (["--until", "5", "--mesh-error"], "--until 5: the error of the mesh is not estimated for slow change yet"),
        (["--with", "drainage"], "drainage: permeability is missing [m4/(N s)]"),
        (
            ["--with", "drainage:permeability=0"],
            "drainage:permeability=0: permeability: found 0, expected a positive number",
        ),
        (["--with", "drainage:permeability=1,drained=no"], "drainage:permeability=1,drained=no: drained: the mesh has"),
    ],
)
def test_bad_arguments(tmp_path, arguments, expected):
    folder = write_folder(tmp_path / "case")
    ran = run(folder, "--out", tmp_path / "out", *arguments)
    assert ran.status == 2
    assert expected in ran.err
    assert not (tmp_path / "out").exists()
