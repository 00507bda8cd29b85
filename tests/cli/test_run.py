"""`warpbrain run` from end to end: what it prints, what it writes, and that every way of asking agrees."""

import json
import re
from pathlib import Path
from typing import Any

import matplotlib.image
import numpy as np
import pytest
from command import Ran, run
from folders import SIDE, block, write_folder

from warpbrain.cases.shipped import STAND_INS
from warpbrain.errors import SolveError
from warpbrain.mesh import TetMesh, write_mesh
from warpbrain.mesh.vtu import read_vtu

FILES = ["deformation.png", "report.html", "result.vtu", "summary.json", "warpbrain.log"]
RAN: dict[tuple[str, ...], tuple[Ran, Path]] = {}


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    return write_folder(tmp_path_factory.mktemp("block"))


@pytest.fixture(scope="module")
def block_run(folder, tmp_path_factory):
    """Runs the block with some arguments, once; returns what was printed and the folder of the results."""

    def call(*arguments: str) -> tuple[Ran, Path]:
        if arguments not in RAN:
            out = tmp_path_factory.mktemp("out")
            RAN[arguments] = run(folder, "--out", out, *arguments), out
        ran, out = RAN[arguments]
        assert (ran.status, ran.err) == (0, "")
        assert sorted(path.name for path in out.iterdir()) == FILES
        return ran, out

    yield call
    RAN.clear()


def displacement(out: Path) -> np.ndarray:
    """[mm]"""
    return read_vtu(out / "result.vtu").point_data["displacement"]


def summary(out: Path) -> dict[str, Any]:
    """The summary as strict JSON: no NaN, no infinity."""

    def refuse(name: str) -> None:
        raise AssertionError(f"summary.json holds {name}")

    return json.loads((out / "summary.json").read_text(encoding="utf-8"), parse_constant=refuse)


def test_what_is_printed(block_run, folder):
    ran, out = block_run()
    lines = ran.out.splitlines()
    assert lines[0] == "A block of gel"
    assert "  mesh      27 nodes, 48 tetrahedra, 27.0 cm3, 0.0270 kg" in lines
    assert "  tissue 1  soft: neo-hookean (coupled), mu = 1000 Pa, nu = 0.45" in lines
    assert "  assumed   The table does not move." in lines
    assert any(line.startswith("  left out  ") for line in lines)
    assert any(re.fullmatch(r"  device    .* \(cpu\), double precision", line) for line in lines)
    assert any(re.match(r" +100\.0 % +1 +\d\.\de[+-]\d\d +\d+ +1 +0\.\d{3}$", line) for line in lines)
    assert any(line.startswith("  converged: relative out-of-balance force ") for line in lines)
    assert any(re.match(r"  all nodes +27( +\d+\.\d{3}){4}$", line) for line in lines)
    assert any(re.match(r"  bottom +9( +0\.000){4}$", line) for line in lines)
    assert any(re.match(r"  top +9( +\d+\.\d{3}){4}$", line) for line in lines)
    for phase in ("pre-processing", "internal forces", "assemble system", "solve system"):
        assert any(re.match(rf"  {phase} +\d+ +\d+\.\d\d +\d+\.\d$", line) for line in lines)
    assert lines[-1] == f"written to {out}: result.vtu, summary.json, deformation.png, report.html"
    # not a stand-in for anybody
    assert "stand-in" not in ran.out


def test_result_file(block_run):
    _, out = block_run()
    file = read_vtu(out / "result.vtu")
    mesh = block()
    np.testing.assert_allclose(file.points, 1000.0 * mesh.points, atol=1e-12)
    assert [block.type for block in file.cells] == ["tetra"]
    np.testing.assert_array_equal(file.cells[0].data, mesh.tetrahedra)
    points, cells = file.point_data, {name: data[0] for name, data in file.cell_data.items()}
    assert set(points) == {"displacement", "reaction", "bottom", "top", "nobody"}
    assert set(cells) == {"tissue", "J", "principal_stretches", "von_mises", "pressure"}
    np.testing.assert_array_equal(cells["tissue"], mesh.tissue)
    np.testing.assert_array_equal(points["top"], mesh.node_sets["top"])
    # F from the file itself: displacement is in the unit of the coordinates
    edges = file.points[mesh.tetrahedra[:, 1:]] - file.points[mesh.tetrahedra[:, :1]]
    moved = file.points + points["displacement"]
    F = np.linalg.solve(edges, moved[mesh.tetrahedra[:, 1:]] - moved[mesh.tetrahedra[:, :1]]).transpose(0, 2, 1)
    np.testing.assert_allclose(cells["J"], np.linalg.det(F), rtol=1e-12)
    np.testing.assert_allclose(cells["principal_stretches"], np.linalg.svd(F, compute_uv=False), rtol=1e-12)
    assert (np.diff(cells["principal_stretches"], axis=1) <= 0.0).all()
    # neo-Hookean Cauchy stress, written again: (mu (b - 1) + lam ln J) / J
    mu = np.where(mesh.tissue == 1, 1000.0, 3000.0)[:, None, None]
    lam = mu * 2.0 * 0.45 / (1.0 - 2.0 * 0.45)
    J = np.linalg.det(F)[:, None, None]
    stress = (mu * (F @ F.transpose(0, 2, 1) - np.eye(3)) + lam * np.log(J) * np.eye(3)) / J
    pressure = -np.trace(stress, axis1=1, axis2=2) / 3.0
    deviator = stress + pressure[:, None, None] * np.eye(3)
    np.testing.assert_allclose(cells["pressure"], pressure, rtol=1e-9, atol=1e-8)
    np.testing.assert_allclose(cells["von_mises"], np.sqrt(1.5 * (deviator**2).sum(axis=(1, 2))), rtol=1e-9)
    # balance: the table pushes back what the press pushes; nothing else is held
    np.testing.assert_allclose(points["reaction"].sum(axis=0), [-0.01, -0.02, 0.05], atol=1e-9)
    assert not points["reaction"][~mesh.node_sets["bottom"]].any()
    assert not points["displacement"][mesh.node_sets["bottom"]].any()


def test_summary_file(block_run, folder):
    ran, out = block_run()
    said = summary(out)
    assert set(said) == {
        "case", "device", "solution", "result", "recordings", "seconds_by_phase", "calls_by_phase",
        "seconds_to_first_step", "versions", "inputs_sha256",
    }  # fmt: skip
    case = said["case"]
    assert (case["name"], case["title"], case["origin"]) == ("block", "A block of gel", "synthetic")
    assert (case["nodes"], case["tetrahedra"]) == (27, 48)
    assert case["file"] == str(folder / "case.toml")
    assert case["volume_cm3"] == pytest.approx(27.0)
    assert case["mass_kg"] == pytest.approx(0.027)
    assert case["density_kg_per_m3"] == 1000.0
    assert case["poisson"] == 0.45
    assert case["tissues"]["2"] == {
        "name": "stiff", "law": "neo-hookean", "formulation": "coupled", "parameters": {"mu": 3000.0},
        "shear_modulus_Pa": 3000.0,
    }  # fmt: skip
    assert said["device"]["alias"] == "cpu"
    assert said["device"]["precision"] == "double"
    assert {"warpbrain", "warp-lang", "numpy", "scipy", "meshio", "python", "platform"} <= set(said["versions"])
    # all sentences that were printed are there, and the numbers are those of the result
    for sentence in (*case["assumptions"], *case["left_out"]):
        assert sentence in ran.out
    sizes = np.linalg.norm(displacement(out), axis=1)
    assert said["result"]["displacement_mm"]["all nodes"] == pytest.approx(
        {
            "nodes": 27,
            "mean": sizes.mean(),
            "root_mean_square": np.sqrt((sizes**2).mean()),
            "percentile_95": np.percentile(sizes, 95),
            "largest": sizes.max(),
        }
    )
    # a set without nodes has no statistics
    assert set(said["result"]["displacement_mm"]) == {"all nodes", "bottom", "top"}
    assert said["result"]["reaction_N"] == pytest.approx([-0.01, -0.02, 0.05])
    assert said["solution"]["kind"] == "equilibrium"
    assert said["solution"]["relative_residual"] <= 1e-8
    assert all(seconds >= 0.0 for seconds in said["seconds_by_phase"].values())
    assert all(count >= 1 for count in said["calls_by_phase"].values())


@pytest.mark.usefixtures("drawn")
def test_picture(folder, tmp_path):
    assert run(folder, "--out", tmp_path).status == 0
    image = matplotlib.image.imread(tmp_path / "deformation.png")
    assert image.shape[0] > 700
    assert image.shape[1] > 1000
    # paper, anatomy and many shades of displacement
    colours = np.unique((255 * image[..., :3]).astype(int) @ [1, 256, 65536])
    assert len(colours) > 100


def test_repeated_runs_give_the_same_bits(block_run, folder, tmp_path):
    _, out = block_run()
    assert run(folder, "--out", tmp_path).status == 0
    assert (tmp_path / "result.vtu").read_bytes() == (out / "result.vtu").read_bytes()
    one, two = summary(out), summary(tmp_path)
    assert one["result"] == two["result"]
    assert one["solution"] == two["solution"]


@pytest.mark.parametrize("arguments", [["--steps", "3"], ["--to-rest"]])
def test_repeated_motion_gives_the_same_bits(block_run, folder, tmp_path, arguments):
    _, out = block_run(*arguments)
    assert run(folder, "--out", tmp_path, *arguments).status == 0
    assert (tmp_path / "result.vtu").read_bytes() == (out / "result.vtu").read_bytes()


def test_motion_comes_to_rest_at_the_equilibrium(block_run):
    static, (ran, rest) = displacement(block_run()[1]), block_run("--to-rest")
    np.testing.assert_allclose(displacement(rest), static, rtol=0, atol=1e-6 * np.abs(static).max())
    assert "  at rest: relative out-of-balance force " in ran.out
    assert summary(rest)["solution"]["kind"] == "at rest"
    assert summary(rest)["solution"]["relative_residual"] <= 1e-8


def test_a_swing_is_told_and_ends_at_the_same_rest(block_run):
    (_, rest), (ran, out) = block_run("--to-rest"), block_run("--to-rest", "--time-step", "0.001")
    np.testing.assert_allclose(
        displacement(out), displacement(rest), rtol=0, atol=1e-6 * np.abs(displacement(rest)).max()
    )
    assert "swing" not in summary(rest)["solution"]
    swing = summary(out)["solution"]["swing"]
    assert swing["time_step_s"] == 0.001
    # Rayleigh damping of 1 ms
    assert swing["damping"] == pytest.approx(np.pi * 1e-3 * swing["frequency_Hz"], rel=0.03)
    assert f"  swings about it at {swing['frequency_Hz']:.4g} Hz with " in ran.out


def test_steps(block_run):
    ran, out = block_run("--steps", "3")
    said = summary(out)["solution"]
    assert said["kind"] == "motion"
    assert said["time_s"] == pytest.approx(0.003)
    assert [line["time_s"] for line in said["history"]] == pytest.approx([0.001, 0.002, 0.003])
    assert summary(out)["calls_by_phase"]["solve system"] == 3
    assert "kinetic energy [mJ]" in ran.out
    # on its way, and not there yet
    static = np.linalg.norm(displacement(block_run()[1]), axis=1).max()
    assert 0.0 < np.linalg.norm(displacement(out), axis=1).max() < 2.5 * static


def test_prescribed_displacement_is_there_however_it_is_reached(tmp_path):
    moved = ('kind = "force"\ntotal = [0.01, 0.02, -0.05]', 'kind = "displacement"\nvalue = [0.3, 0.0, -0.6]')
    write_folder(tmp_path / "case", moved)
    reached = {}
    for name, arguments in {"static": [], "rest": ["--to-rest"], "steps": ["--steps", "2"]}.items():
        ran = run(tmp_path / "case", "--out", tmp_path / name, *arguments)
        assert (ran.status, ran.err) == (0, "")
        reached[name] = displacement(tmp_path / name)
        top = block().node_sets["top"]
        np.testing.assert_allclose(reached[name][top], np.tile([0.3, 0.0, -0.6], (9, 1)), atol=1e-9)
    np.testing.assert_allclose(reached["rest"], reached["static"], atol=1e-6)


def test_single_precision(block_run):
    ran, out = block_run("--precision", "single")
    static = displacement(block_run()[1])
    np.testing.assert_allclose(displacement(out), static, rtol=0, atol=1e-3 * np.abs(static).max())
    assert "single precision" in ran.out
    assert summary(out)["device"]["precision"] == "single"


@pytest.mark.parametrize("model", ["neo-hookean", "mooney-rivlin", "ogden"])
def test_models(block_run, model):
    ran, out = block_run("--model", model)
    tissues = summary(out)["case"]["tissues"]
    assert {tissue["law"] for tissue in tissues.values()} == {model}
    assert [tissues[label]["shear_modulus_Pa"] for label in "12"] == pytest.approx([1000.0, 3000.0])
    assert f"soft: {model} (coupled), mu = 1000 Pa" in ran.out
    # the same small-strain limit: a few per cent of strain make a few per cent of difference
    static = displacement(block_run()[1])
    np.testing.assert_allclose(displacement(out), static, rtol=0, atol=0.05 * np.abs(static).max())
    assert (model == "neo-hookean") == np.array_equal(displacement(out), static)


def test_one_shear_modulus_for_every_tissue_or_one_for_each(block_run):
    one, two = (block_run("--mu", *values)[1] for values in (["1500"], ["1=1500", "2=1500"]))
    assert (one / "result.vtu").read_bytes() == (two / "result.vtu").read_bytes()
    assert summary(one)["case"]["tissues"]["2"]["shear_modulus_Pa"] == 1500.0


def test_shear_modulus_of_one_tissue(block_run):
    _, out = block_run("--mu", "2=1500")
    tissues = summary(out)["case"]["tissues"]
    assert [tissues[label]["shear_modulus_Pa"] for label in "12"] == [1000.0, 1500.0]


def test_twice_as_stiff_under_twice_the_force(block_run, tmp_path):
    write_folder(tmp_path / "case", ("[0.01, 0.02, -0.05]", "[0.02, 0.04, -0.1]"))
    assert run(tmp_path / "case", "--mu", "1=2000", "2=6000", "--out", tmp_path / "out").status == 0
    static = displacement(block_run()[1])
    np.testing.assert_allclose(displacement(tmp_path / "out"), static, rtol=0, atol=1e-7 * np.abs(static).max())


def test_poisson(block_run):
    ran, out = block_run("--poisson", "0.2")
    assert "nu = 0.2" in ran.out
    assert summary(out)["case"]["poisson"] == 0.2
    # less than 0.45 resists a change of volume less
    J, J_of_case = (summary(place)["result"]["volume_ratio_J"] for place in (out, block_run()[1]))
    assert J["smallest"] < J_of_case["smallest"]


def test_units_and_axes_change_nothing(block_run, tmp_path):
    """In metres and LPS: the same displacement in mm and RAS."""
    case = write_folder(tmp_path / "case", ('"mm"', '"m"'), ('"RAS"', '"LPS"'), ("[0.01, 0.02,", "[-0.01, -0.02,"))
    mesh = block()
    turned = TetMesh(mesh.points * [-1, -1, 1], mesh.tetrahedra, mesh.tissue, mesh.node_sets, mesh.element_sets)
    write_mesh(case / "mesh.vtu", turned, unit="m")
    assert run(case, "--out", tmp_path / "out").status == 0
    static = displacement(block_run()[1])
    np.testing.assert_allclose(displacement(tmp_path / "out"), static, rtol=0, atol=1e-7 * np.abs(static).max())
    np.testing.assert_allclose(read_vtu(tmp_path / "out" / "result.vtu").points.max(axis=0), 1000.0 * SIDE)


def test_quiet_prints_nothing(folder, tmp_path, capfd):
    assert run(folder, "--quiet", "--out", tmp_path) == Ran(0, "", "")
    # not past Python either
    assert capfd.readouterr() == ("", "")
    assert sorted(path.name for path in tmp_path.iterdir()) == FILES


def test_results_go_to_a_folder_named_after_the_case(folder, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert run(folder).status == 0
    assert sorted(path.name for path in (tmp_path / "warpbrain-block-multi").iterdir()) == FILES
    assert len(list(tmp_path.iterdir())) == 1


def test_a_load_without_an_answer(folder, tmp_path):
    """Status 1, one line that says at what load fraction, where and why; results that were there stay whole."""
    out = tmp_path / "out"
    assert run(folder, "--out", out).status == 0
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    crushed = write_folder(tmp_path / "case", ("-0.05]", "-500.0]"))
    ran = run(crushed, "--out", out, "--overwrite")
    assert ran.status == 1
    assert re.fullmatch(
        r"warpbrain: no equilibrium found beyond [\d.e-]+ % of the load, after \d+ Newton iterations .*"
        r"element \d+ at \([-\d., ]+\) mm, tissue [12], J = .*\n",
        ran.err,
    ), ran.err
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before


@pytest.mark.parametrize("arguments", [["--to-rest"], ["--steps", "30"]])
def test_a_motion_without_an_answer(tmp_path, arguments):
    crushed = write_folder(tmp_path / "case", ("-0.05]", "-500.0]"))
    ran = run(crushed, "--out", tmp_path / "out", *arguments)
    assert ran.status == 1
    # at which step it ends, or whether it does, is rounding's: an element turns inside out, or there is no rest
    assert re.fullmatch(r"warpbrain: .+ [\d.e-]+ m?s\b.*\n", ran.err), ran.err
    assert not (tmp_path / "out").exists()


def test_clinical_case(tmp_path):
    ran = run("0529", "--tissue", "single", "--out", tmp_path)
    assert (ran.status, ran.err) == (0, "")
    assert "a stand-in: the MNI anatomy deformed and scaled to the paper's volume, not the patient's images" in ran.out
    assert "(before resection 1165.4 cm3)" in ran.out
    for name in ("ventricles", "cavity margin", "outer surface"):
        assert re.search(rf"^  {name} +\d+( +\d+\.\d{{3}}){{4}}$", ran.out, re.MULTILINE)
    said = summary(tmp_path)
    # Table 4 of the paper's supplement
    assert said["case"]["volume_before_resection_cm3"] == pytest.approx(1165.4, abs=0.05)
    assert said["case"]["density_kg_per_m3"] == 1211.5
    assert said["case"]["mass_kg"] == pytest.approx(1211.5e-6 * said["case"]["volume_cm3"])
    assert said["case"]["volume_cm3"] < 1165.0
    assert said["case"]["origin"] == "stand-in"
    assert said["solution"]["relative_residual"] <= 1e-8
    moved = said["result"]["displacement_mm"]
    assert {"ventricle", "resection", "surface", "fixed"} <= set(moved)
    assert moved["fixed"]["largest"] == 0.0
    # a brain that sinks by tenths of a millimetre to millimetres, as far as its fluid drained
    assert 0.1 < moved["ventricle"]["mean"] < 20.0
    file = read_vtu(tmp_path / "result.vtu")
    assert (file.cell_data["J"][0] > 0.0).all()
    # along gravity, to the back
    assert file.point_data["displacement"][:, 1].mean() < -0.1


# of one tissue a stand-in runs in `test_clinical_case`; all of them are read in tests/cases
@pytest.mark.parametrize("tissue", [pytest.param("single", marks=pytest.mark.slow), "multi"])
@pytest.mark.parametrize(
    # that of the README, and one of the other side
    "name",
    [pytest.param(name, marks=[] if name in ("0614", "0603") else [pytest.mark.slow(1)]) for name in STAND_INS],
)
def test_every_stand_in_runs_and_is_compared(tmp_path, name, tissue):
    ran = run(name, "--tissue", tissue, "--out", tmp_path)
    assert (ran.status, ran.err) == (0, "")
    compared = summary(tmp_path)["recordings"]["compared"]
    assert [entry["name"] for entry in compared] == ["ventricles", "cavity"]
    for entry in compared:
        assert re.search(rf"^  {entry['name']} +{entry['count']}( +\d+\.\d{{3}}){{3}} mm$", ran.out, re.MULTILINE)
        assert entry["before"]["root_mean_square"] > 2.0 * entry["noise_root_mean_square"] / 3.0**0.5
        # what is declared is not all that acted: no simulation of it comes down to the noise
        assert entry["after"]["root_mean_square"] > entry["noise_root_mean_square"]


# -- the error of the mesh ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("arguments", [(), ("--steps", "3"), ("--to-rest",), ("--elements", "tet4-averaged")])
def test_error_of_the_mesh(folder, tmp_path, arguments):
    """Printed, in the summary and in the mesh's file; the rest of the run is as it is without it."""
    ran = run(folder, "--mesh-error", *arguments, "--out", tmp_path)
    assert (ran.status, ran.err) == (0, "")
    said = summary(tmp_path)["mesh_error"]
    file = read_vtu(tmp_path / "result.vtu")
    sizes = np.linalg.norm(file.point_data["mesh_error"], axis=1)
    for key, expected in (("median", np.median(sizes)), ("largest", sizes.max())):
        assert said["displacement_mm"][key] == pytest.approx(expected, rel=1e-6)
    assert sizes.max() > 0.0
    printed = float(re.findall(r"  all nodes +(\S+)", ran.out)[-1])
    assert printed == pytest.approx(np.median(sizes), rel=5e-3, abs=5e-4)
    averaged = "tet4-averaged" in arguments
    assert (said["locking_mm"] is None) == averaged and said["element_size_mm"]["largest"] > 0.0
    # nothing is said of what does not lock
    assert ("linear tetrahedra" in ran.out) != averaged
    assert "compared with" in said["how"]


def test_error_of_elements_alone(block_run, folder, tmp_path):
    """What `--elements tet4-averaged` changes."""
    plain, averaged = (displacement(block_run(*extra)[1]) for extra in ((), ("--elements", "tet4-averaged")))
    assert run(folder, "--mesh-error", "elements", "--out", tmp_path, "--quiet") == Ran(0, "", "")
    found = read_vtu(tmp_path / "result.vtu").point_data["mesh_error"]
    np.testing.assert_allclose(found, averaged - plain, atol=1e-4 * np.abs(plain).max())
    wrong = run(folder, "--mesh-error", "elements", "--elements", "tet4-averaged", "--out", tmp_path / "none")
    assert wrong.status == 2 and "--mesh-error elements: compares with tet4-averaged" in wrong.err
    assert not (tmp_path / "none").exists()


def test_a_run_stands_where_the_error_of_its_mesh_is_not_found(folder, tmp_path, monkeypatch):
    def fail(*_arguments: object, **_options: object) -> None:
        raise SolveError("on elements tet4-averaged: no equilibrium")

    monkeypatch.setattr("warpbrain.cli.run_case.mesh_error", fail)
    ran = run(folder, "--mesh-error", "--out", tmp_path)
    assert (ran.status, ran.err) == (0, "")
    assert "error of the mesh: not known: on elements tet4-averaged: no equilibrium" in ran.out
    assert summary(tmp_path)["mesh_error"] == {"unknown": "on elements tet4-averaged: no equilibrium"}
    assert "mesh_error" not in read_vtu(tmp_path / "result.vtu").point_data
