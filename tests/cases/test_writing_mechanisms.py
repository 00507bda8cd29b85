"""Every mechanism with every key is written and read back as what does the same, in any units and axes."""

import dataclasses
from dataclasses import replace

import numpy as np
import pytest
from folders import block, write_folder
from same_case import assert_same

from warpbrain.cases.reading import read_case
from warpbrain.cases.writing import write_case
from warpbrain.errors import InputError
from warpbrain.frame import Frame
from warpbrain.mesh import TetMesh
from warpbrain.physics.mechanism import ClosedSurface, Facts, Mechanism, Removing
from warpbrain.physics.mechanisms import mechanisms
from warpbrain.physics.mechanisms.gravity import Gravity
from warpbrain.physics.mechanisms.resection import Resection

FRAMES = [Frame("mm", "LPS"), Frame("m", "RAS"), Frame("m", "LPS")]
CORNERS = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
SKULL = ClosedSurface("skull.stl", CORNERS - 0.2, np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], np.int32))


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    """The block, with a field of directions."""
    mesh = block(3)
    field = np.random.default_rng(0).normal(size=(len(mesh.tetrahedra), 3))
    vectors = {"f.csv": field / np.linalg.norm(field, axis=1, keepdims=True)}
    mesh = TetMesh(mesh.points, mesh.tetrahedra, mesh.tissue, mesh.node_sets, mesh.element_sets, vectors)
    read = read_case(write_folder(tmp_path_factory.mktemp("block")))
    return replace(read, mesh=mesh, gravity_axis=(0.0, 0.6, -0.8))


def drawn(kind: type[Mechanism], case, rng) -> Mechanism:
    """A mechanism of the case with some of its keys, whatever makes sense."""
    while True:
        keys = [name for name in kind.parameters() if name in kind.required() or rng.random() < 0.6]
        values = {name: value(kind, name, case, rng) for name in keys}
        times = np.sort(rng.uniform(0.0, 5.0, 2))
        ramp = tuple(zip(times.tolist(), rng.uniform(0.0, 1.0, 2).tolist(), strict=True)) if rng.random() < 0.5 else ()
        try:
            return kind.of_case({**values, "ramp": ramp}, Facts(case.mesh, case.gravity_axis, case.density))
        except InputError:
            continue


def value(kind, name, case, rng):
    spec = kind.parameters()[name]
    if spec.kind == "text":
        return str(rng.choice(spec.choices))
    sets = {"node set": ["top", "bottom"], "element set": ["corner"], "directions": ["f.csv"]}
    if spec.kind in sets:
        return str(rng.choice(sets[spec.kind]))
    if spec.kind == "surface":
        return SKULL
    if spec.kind == "position":
        return tuple(rng.uniform(0.0, 0.03, 3).tolist())
    if spec.kind == "vector":
        return tuple((spec.si * rng.normal(size=3)).tolist())
    if spec.kind == "numbers":
        return tuple((spec.si * rng.uniform(0.1, 0.5, 2)).tolist())
    low, high = max(spec.above, -1e3), min(spec.below, 1e3)
    return spec.si * float(low + (high - low) * rng.uniform(0.01, 0.99) ** rng.integers(1, 6))


@pytest.mark.parametrize("kind", list(mechanisms()))
def test_a_mechanism_comes_back(tmp_path, case, kind):
    written = set()
    for seed in range(9):
        rng = np.random.default_rng(seed)
        mechanism = drawn(mechanisms()[kind], case, rng)
        before = replace(case, mechanisms=(mechanism,), frame=FRAMES[seed % 3])
        after = read_case(write_case(tmp_path / str(seed), before).parent)
        assert_same(before, after)
        written |= {name for name in mechanism.parameters() if getattr(mechanism, name) not in (None, "")}
    assert written == set(mechanisms()[kind].parameters())


@pytest.mark.parametrize("resected", [False, True])
@pytest.mark.parametrize("level", [None, 0.012])
@pytest.mark.parametrize("lowest", [None, -0.05])
def test_gravity_that_no_file_said_acts_alike(tmp_path, case, resected, level, lowest):
    """Of a density of its own, imaged as it acts, and of a level that is counted from anywhere."""
    gravity = Gravity(direction=(0.3, -1.0, 0.2), density=870.0, csf_level=level, lowest=lowest)
    removing = (Resection(elements="corner"),) if resected else ()
    written = write_case(tmp_path / "case", replace(case, mechanisms=(*removing, gravity)))
    again = read_case(written.parent)
    [read] = [one for one in again.mechanisms if isinstance(one, Gravity)]
    np.testing.assert_allclose(
        read.unit_forces(again.remaining[0]), gravity.unit_forces(case_left(case, removing)), rtol=1e-9, atol=1e-16
    )
    assert (read.density, read.imaged_direction) == (870.0, pytest.approx(gravity.direction))


def case_left(case, removing):
    return Facts(case.mesh, removing=tuple(one for one in removing if isinstance(one, Removing))).left


def test_all_that_a_mechanism_holds_is_a_key():
    """What else a class has, `of_case` finds and `in_case` says by keys."""
    others = {
        (kind, field.name)
        for kind, mechanism in mechanisms().items()
        for field in dataclasses.fields(mechanism)
        if "spec" not in field.metadata and field.name != "ramp"
    }
    assert others == {("gravity", "lowest")}
