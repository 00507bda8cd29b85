"""What a 3-D view is given: cuts lie in their planes, and carry what nodes carry."""

import base64

import numpy as np
import pytest
from shapes import box

from warpbrain.report.page.scene import Arrows, Field, describe_scene, scene_json


def floats(text: str, width: int = 3) -> np.ndarray:
    return np.frombuffer(base64.b64decode(text), "<f4").reshape(-1, width)


@pytest.fixture(scope="module")
def scene():
    mesh = box((4, 4, 4), (0.06, 0.04, 0.02))
    linear = mesh.points @ [1.0, 2.0, 3.0]
    u = mesh.points * [0.1, 0.0, -0.1]
    return describe_scene(
        mesh, [Field("f", "f [1]", linear, 0.0, 0.1)], np.zeros((1, 3)), [Arrows("a", "#102030", np.ones((1, 3)))],
        None, u, 5.0, [("axial", 2, 0.007), ("outside", 0, 1.0)],
    )  # fmt: skip


def test_a_cut_has_the_area_of_its_plane(scene, verify):
    cut = scene["cuts"][0]
    points = floats(cut["points"]).astype(np.float64)
    triangles = np.frombuffer(base64.b64decode(cut["triangles"]), "<u4").reshape(-1, 3)
    a, b, c = points[triangles].transpose(1, 0, 2)
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()
    verify("Area of a plane cut in the 3-D view", "sides of the block, in mm2", abs(area / (60.0 * 40.0) - 1.0), 1e-6)
    np.testing.assert_allclose(points[:, 2], 7.0, rtol=1e-6)


def test_linear_fields_are_exact_in_a_cut(scene):
    cut = scene["cuts"][0]
    points = floats(cut["points"])
    np.testing.assert_allclose(floats(cut["values"][0], 1)[:, 0], 1e-3 * points @ [1.0, 2.0, 3.0], rtol=1e-5)
    np.testing.assert_allclose(floats(cut["moves"]), points * [0.1, 0.0, -0.1], rtol=1e-4, atol=1e-5)


def test_a_plane_beside_the_body_is_empty(scene):
    cut = scene["cuts"][1]
    assert cut["points"] == cut["triangles"] == ""


def test_surface_and_motion_match(scene):
    points = floats(scene["points"])
    np.testing.assert_allclose(floats(scene["moves"]), points * [0.1, 0.0, -0.1], rtol=1e-4, atol=1e-5)
    assert scene["exaggeration"] == 5.0 and scene["arrows"][0]["colour"] == [16, 32, 48]


def test_no_word_ends_the_element_that_it_is_in():
    assert "</script>" not in scene_json({"name": "</script>"})
