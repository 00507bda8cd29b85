"""A specimen is meshed as its shape says, and its folder is read and written."""

import numpy as np
import pytest

from warpbrain.cases.checking import check_case
from warpbrain.cases.reading import read_case
from warpbrain.cases.specimen import Specimen
from warpbrain.cases.writing import write_case
from warpbrain.mesh import boundary_faces, measure
from warpbrain.mesh.surface import face_vectors

CASE = """\
[case]
name = "disc"
origin = "measured"

[specimen]
shape = "cylinder"
radius = 4.0
height = 4.541
grips = "glued"

[tissue.1]
mu = 1000.0

[[recording]]
name = "cycle 1"
kind = "test"
mode = "axial"
file = "cycle1.csv"
"""


def write(folder, text=CASE, table="t,displacement,force\n0,0,0\n1,-0.1,-0.02\n2,-0.2,-0.05\n"):
    folder.mkdir(exist_ok=True)
    (folder / "case.toml").write_text(text)
    (folder / "cycle1.csv").write_text(table)
    return folder


@pytest.mark.parametrize(
    ("specimen", "volume"),
    [
        (Specimen("cylinder", (8e-3, 8e-3, 4.541e-3), "glued"), np.pi * 16e-6 * 4.541e-3),
        (Specimen("cylinder", (8e-3, 8e-3, 40e-3), "lubricated"), np.pi * 16e-6 * 40e-3),
        (Specimen("block", (5e-3, 5e-3, 5e-3), "glued"), 125e-9),
        (Specimen("block", (2e-3, 9e-3, 30e-3), "glued"), 540e-9),
    ],
)
def test_mesh(specimen, volume):
    mesh = specimen.mesh()
    assert mesh.volume == pytest.approx(volume, rel=1e-12)
    quality = measure(mesh)
    assert quality.components == 1 and quality.min_dihedral > 20.0
    z = mesh.points[:, 2]
    np.testing.assert_array_equal(mesh.node_sets["bottom"], z == 0.0)
    np.testing.assert_array_equal(mesh.node_sets["top"], z == z.max())
    assert z.max() == specimen.size[2]
    np.testing.assert_allclose(mesh.points[:, :2].min(axis=0), -mesh.points[:, :2].max(axis=0), atol=1e-12)
    # every face of the surface has all its nodes in the sets together, and the ends have their area
    faces = boundary_faces(mesh.tetrahedra)
    assert np.any([mesh.node_sets[name] for name in ("bottom", "top", "side")], axis=0)[faces].all()
    end = faces[mesh.node_sets["top"][faces].all(axis=1)]
    assert face_vectors(mesh.points, end).sum(axis=0)[2] == pytest.approx(volume / specimen.size[2])


def test_a_specimen_is_read_and_written(tmp_path):
    case = read_case(write(tmp_path / "a"))
    assert case.specimen == Specimen("cylinder", (0.008, 0.008, pytest.approx(0.004541)), "glued")
    [test] = case.recordings
    assert (test.mode, test.quantities) == ("axial", ("displacement", "force"))
    np.testing.assert_allclose(test.imposed, [0.0, -1e-4, -2e-4])
    again = read_case(write_case(tmp_path / "b", case))
    assert again.specimen == case.specimen
    np.testing.assert_allclose(again.recordings[0].imposed, test.imposed, rtol=1e-14)


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ('"cylinder"', '"ball"', "[specimen] shape: found 'ball', expected one of cylinder, block"),
        ("radius = 4.0\n", "", "[specimen] radius: missing (expected a finite number [units])"),
        ("radius = 4.0", "radius = -4.0", "[specimen] radius: found -4, expected a positive number [units]"),
        ("radius = 4.0", "size = [1, 2, 3]", "[specimen] size: means nothing with shape 'cylinder'"),
        ("radius = 4.0", "radius = 4000.0", "[specimen] shape: 8000 long and 4.541 thick: too slender"),
        (
            '"axial"',
            '"bending"',
            "[recording 1] mode: found 'bending', expected one of axial, shear, torsion, confined",
        ),
        ('"axial"', '"axial"\nunit = "MPa"', "[recording 1] unit: found 'MPa', expected one of Pa, kPa"),
        ('"axial"', '"axial"\nstress = "true"', "[recording 1] stress: found 'true', expected one of nominal, cauchy"),
        ('"axial"', '"axial"\nunit = "kPa"', "[recording 1] unit: means nothing of displacement and force"),
        ("mu = 1000.0", "mu = 10.0e6", "[recording 1] file: the force is 0.00075 times what the declared tissue"),
        (
            'kind = "test"\nmode = "axial"',
            'kind = "points"',
            "[recording 1] kind: 'points' belongs to a case with [mesh]",
        ),
        ("[tissue.1]", '[mesh]\nfile = "m.vtu"\n[tissue.1]', "[mesh]: means nothing with [specimen]"),
        (
            "[tissue.1]",
            "[body]\nheterogeneity = 0.1\n[tissue.1]",
            "[body] heterogeneity: means nothing with a [specimen]",
        ),
        ('shape = "cylinder"\nradius = 4.0\nheight = 4.541', 'shape = "block"\nsize = [1, 0, 1]', "3 positive numbers"),
    ],
)
def test_what_is_wrong_is_named(tmp_path, old, new, expected):
    assert old in CASE
    found = check_case(write(tmp_path, CASE.replace(old, new))).problems
    assert any(expected in str(problem) for problem in found), found


def test_a_force_controlled_test_is_read_and_written(tmp_path):
    text = CASE.replace('mode = "axial"', 'mode = "axial"\ncontrol = "force"\nsigma = 0.01')
    case = read_case(write(tmp_path / "a", text))
    [test] = case.recordings
    assert test.controlled[0] == "force" and test.answer[0] == "displacement"
    # noise of what was read, a displacement in mm
    assert test.sigma == pytest.approx(1e-5)
    again = read_case(write_case(tmp_path / "b", case)).recordings[0]
    assert again.control == "force" and again.sigma == pytest.approx(1e-5)


STRESSES = "stretch,stress\n1.0,0.0\n0.9,-400.0\n0.8,-1000.0\n1.25,700.0\n"


@pytest.mark.parametrize("mode", ["axial", "confined"])
@pytest.mark.parametrize("stress", ["nominal", "cauchy"])
@pytest.mark.parametrize("unit", ["Pa", "kPa"])
def test_stresses_become_nominal_ones_in_pascals(tmp_path, mode, stress, unit):
    mu = {"Pa": "1000.0", "kPa": "1.0e6"}[unit]
    keys = f'mode = "{mode}"\nstress = "{stress}"\nunit = "{unit}"\nsigma = 5.0'
    text = CASE.replace('mode = "axial"', keys).replace("mu = 1000.0", f"mu = {mu}")
    case = read_case(write(tmp_path / "a", text, STRESSES))
    [test] = case.recordings
    factor, stretch, values = {"Pa": 1.0, "kPa": 1e3}[unit], test.imposed, np.array([0.0, -400.0, -1000.0, 700.0])
    # between walls the area stays; else it is that of an incompressible specimen, 1 / stretch of that at rest
    area = 1.0 / stretch if (stress, mode) == ("cauchy", "axial") else 1.0
    np.testing.assert_allclose(test.response, factor * values * area)
    assert test.sigma == factor * 5.0
    # written as nominal stresses in pascals, without the keys
    again = read_case(write_case(tmp_path / "b", case)).recordings[0]
    np.testing.assert_allclose(again.response, test.response, rtol=1e-14)


@pytest.mark.parametrize(
    ("unit", "times", "said"),
    [("Pa", 1e-3, ("the stress is 0.00", 'perhaps unit = "kPa"')), ("kPa", 1.0, ("the stress is 1", 'unit = "Pa"'))],
)
def test_a_stress_of_another_order_of_magnitude_is_an_error(tmp_path, unit, times, said):
    rows = [line.split(",") for line in STRESSES.split()[1:]]
    table = "stretch,stress\n" + "".join(f"{l},{times * float(s)}\n" for l, s in rows)
    text = CASE.replace('mode = "axial"', f'mode = "axial"\nunit = "{unit}"')
    [problem] = check_case(write(tmp_path, text, table)).problems
    words = (*said, "[recording 1] unit: ", f"(mu = 1000 Pa) answers if it is in {unit}")
    assert all(word in str(problem) for word in words), str(problem)
    # only small strains tell: a law with a large exponent stiffens by more than that
    steep = text.replace('unit = "kPa"', 'unit = "Pa"')
    stretches = np.array([1.0, 0.98, 0.95, 0.7])
    stresses = 2.0 * 1000.0 / -20.0 * (stretches**-21 - stretches**9)
    assert abs(stresses[-1]) > 100.0 * 3.0 * 1000.0 * 0.3
    rows = "".join(f"{l},{s}\n" for l, s in zip(stretches, stresses, strict=True))
    assert not check_case(write(tmp_path, steep, "stretch,stress\n" + rows)).problems
    # a tissue that is ten times stiffer or softer than declared is another tissue, not another unit
    for mu in ("100.0", "10000.0"):
        other = text.replace("mu = 1000.0", f"mu = {mu}").replace('unit = "kPa"', 'unit = "Pa"')
        assert not check_case(write(tmp_path, other, STRESSES)).problems
