"""Cases that share a declared body: drawn as others are, small in one file, and read back as each by itself."""

import subprocess
import sys
from collections import Counter
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from concealed.sealing import open_sealed, read_sealed
from referee import make
from referee.bodies import assigned, draw_bodies, on_body
from referee.challenge.export import neutral_case
from referee.challenge.neutral import NeutralCase, read_case
from referee.challenge.pack import pack, shared_body
from referee.challenge.packed import read_body, write_body
from referee.challenge.shared import COLUMNS
from referee.draw import trapped
from referee.errors import InputError
from referee.geometry import COARSE
from referee.plan import Planned, planned
from referee.setting import draw_setting
from warpbrain.cases.reading import read_case as read_folder

ROOT = Path(__file__).resolve().parents[2]
GEOMETRIES = ["phantom", "phantom", "0603"]


@pytest.fixture(scope="module")
def drawn():
    plans = planned("challenge", 500, GEOMETRIES, 5)
    bodies = draw_bodies(24, GEOMETRIES, 5, coarse=True)
    return plans, bodies, assigned(plans, bodies, 5)


def test_every_body_has_about_as_many_cases_of_all_kinds(drawn):
    plans, bodies, chosen = drawn
    counts = Counter(chosen)
    assert {counts[k] for k in range(24)} <= {19, 20, 21, 22}
    kinds = Counter((plan.kind, k) for plan, k in zip(plans, chosen, strict=True))
    for k in range(24):
        # what is rarest is missing in some body at most
        assert sum(kinds[kind, k] > 0 for kind in ("none", "effect", "two", "outside", "trap")) >= 4
    assert sum(bool(body.times) for body in bodies) == 6
    assert {plans[k].names for k in range(500) if bodies[chosen[k]].mesh == COARSE} == {("coarse",)}


def test_a_body_fits_its_cases(drawn):
    plans, bodies, chosen = drawn
    for plan, k in zip(plans, chosen, strict=True):
        assert plan.geometry == bodies[k].geometry
        assert bodies[k].times or "viscoelasticity" not in plan.names
        assert bodies[k].declares_sigma or plan.names != ("noise",)


def test_too_few_bodies_are_refused(drawn):
    plans, bodies, _ = drawn
    with pytest.raises(InputError, match="no body fits"):
        assigned(plans, bodies[:2], 5)


def test_nothing_that_is_concealed_is_shared(small):
    body = draw_bodies(4, ["phantom"], 3, coarse=False)[3]
    one, other = (on_body(draw_setting(np.random.default_rng(k), "phantom", True), body) for k in (1, 2))
    same = {field.name for field in fields(one) if getattr(one, field.name) == getattr(other, field.name)}
    concealed = {"shape", "mu", "poisson", "field_sd", "field_length", "field_seed", "noise", "shift", "turn", "seed"}
    assert not same & concealed
    assert {"total", "moved", "sigma", "declares_sigma", "points", "surface", "times", "sites"} <= same


def test_places_say_nothing_of_a_body_that_is_bent(small):
    body = draw_bodies(1, ["phantom"], 3, coarse=False)[0]
    random = np.random.default_rng(2)
    plain = on_body(draw_setting(random, "phantom", False), body)
    bent = trapped(random, "segmentation", plain)
    assert not np.allclose(bent.body.points, plain.body.points, atol=1e-4)
    truths = [make.solve_truth(setting, ()) for setting in (plain, bent)]
    places = [truth.tracked(truth.sensors.fitted)[0] for truth in truths]
    np.testing.assert_array_equal(*places)


def test_values_between_nodes_are_those_of_the_shape_functions(small_body):
    random = np.random.default_rng(3)
    inside = small_body.centroids[random.integers(len(small_body.centroids), size=30)]
    cells, shapes = small_body.at(inside + 1e-4 * random.normal(size=inside.shape))
    np.testing.assert_allclose(shapes.sum(axis=1), 1.0)

    def field(x):
        return x[..., 0] ** 2 - 3.0 * x[..., 1] * x[..., 2]

    at = np.einsum("ka,kai->ki", shapes, small_body.points[cells])
    found = (shapes * field(small_body.points[cells])).sum(axis=1)
    # quadratic elements hold a quadratic field exactly
    np.testing.assert_allclose(found, field(at), atol=1e-15)
    corner = small_body.points.max(axis=0)
    cells, shapes = small_body.at(corner[None] + 0.01)
    np.testing.assert_allclose(shapes[0] @ small_body.points[cells[0]], corner, atol=1e-12)


@pytest.fixture(scope="module")
def walled(small_case):
    """Two cases of the small body; other recordings of the same points, the wall and the force."""
    random = np.random.default_rng(6)
    points, wall, force = small_case.recordings
    check = replace(points, role="check", points=points.points[:3], displacement=np.zeros((3, 3)), ids=("a", "b", "c"))
    points = replace(points, ids=tuple(f"P{k}" for k in range(len(points.points))))
    other = (
        replace(points, displacement=np.round(points.displacement + 1e-3 * random.normal(size=points.points.shape), 7)),
        replace(wall, points=np.round(wall.points + 3e-4 * random.normal(size=wall.points.shape), 7)),
        replace(force, force=force.force + 0.1, sigma=0.06),
        check,
    )
    first = (
        replace(points, displacement=np.round(points.displacement, 7)),
        replace(wall, points=np.round(wall.points, 7)),
        force,
        check,
    )
    return [replace(small_case, name=name, recordings=r) for name, r in (("one", first), ("two", other))]


def test_a_packed_case_is_that_which_is_exported(walled, tmp_path):
    write_body(tmp_path / "body.npz", shared_body(walled, "", "mesh.vtu"))
    body = read_body(tmp_path / "body.npz")
    for k, case in enumerate(walled):
        found, expected = body.case(k), neutral_case(case)
        assert found.name == expected.name
        for field in fields(NeutralCase):
            a, b = (getattr(one, field.name) for one in (found, expected))
            if field.name in COLUMNS:
                # half a part of the largest of three components of a node, at three nodes
                most = np.abs(b).max(axis=0)
                assert (np.abs(a - b) <= 1e-3 * most + 1e-12).all(), field.name
            elif isinstance(b, np.ndarray) and b.dtype.kind == "f":
                # weights on the wall are in single precision: 1e-7 of an edge of 4 cm
                np.testing.assert_allclose(a, b, rtol=1e-6, atol=1e-8, err_msg=field.name)
            else:
                np.testing.assert_array_equal(a, b, err_msg=field.name)


def test_what_is_no_body_is_refused(tmp_path):
    (tmp_path / "body.npz").write_bytes(b"no")
    with pytest.raises(InputError, match=r"body\.npz: not a body"):
        read_body(tmp_path / "body.npz")


_UNPACK = """
import sys

class Blocked:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in ("warpbrain", "warp", "felupe", "rslab"):
            raise ImportError(f"{name} is not here")

sys.meta_path.insert(0, Blocked())
from referee.__main__ import main
packed, out = sys.argv[1:]
assert main(["challenge", "unpack", out, "--packed", packed]) == 0
assert main(["challenge", "unpack", out, "--packed", packed, "--only", "nobody"]) == 2
assert main(["challenge", "unpack", out, "--packed", out + "/a"]) == 2
"""


def test_cases_come_back_without_warpbrain(small, tmp_path):
    body = draw_bodies(1, ["phantom"], 4, coarse=False)[0]
    body = replace(body, surface=True, moved=(0.0, 0.0, -0.004), total=None)
    names = ["cha-001", "cha-002"]
    for k, plan in enumerate([Planned("none", (), "phantom"), Planned("trap", ("segmentation",), "phantom")]):
        make.make_case(tmp_path, names[k], plan, [8, k], body)
    assert pack(tmp_path / "cases", tmp_path / "packed") == 1
    command = [sys.executable, "-c", _UNPACK, str(tmp_path / "packed"), str(tmp_path / "out")]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "has no case nobody" in done.stderr and "has no bodies" in done.stderr
    for name in names:
        case, made = read_folder(tmp_path / "out" / name), read_folder(tmp_path / "cases" / name)
        assert len(case.recordings) == 4
        assert (case.name, case.boundaries, case.tissues) == (made.name, made.boundaries, made.tissues)
        for a, b in zip(case.recordings, made.recordings, strict=True):
            assert (a.kind, a.name, a.role, a.sigma) == (b.kind, b.name, b.role, b.sigma)
            for array in ("points", "displacement", "force"):
                if hasattr(b, array):
                    np.testing.assert_allclose(getattr(a, array), getattr(b, array), atol=1e-12)
        neutral = read_case(tmp_path / "out" / f"{name}.npz")
        assert {*neutral.sensor_kind} == {"displacement", "wall", "force"}
    label = open_sealed(read_sealed(tmp_path / "labels" / "cha-002.json.gz"))
    np.testing.assert_allclose(case.recordings[0].points, np.array(label["points_m"]), atol=1e-6)


def test_the_same_body_gives_the_same_file(walled, tmp_path):
    body = shared_body(walled, "text", "mesh.vtu")
    for name in ("a.npz", "b.npz"):
        write_body(tmp_path / name, body)
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()
    with pytest.raises(InputError, match="whole numbers"):
        write_body(tmp_path / "c.npz", replace(body, wall=body.wall + 3e-8))
