"""Pre-processing is measured on bodies that no cache has seen. No time is asserted."""

import functools
import inspect
import itertools
import sys

import numpy as np
import pytest
from shapes import cube

from warpbrain.bench import measure
from warpbrain.bench.measure import case_of, fresh_arrays
from warpbrain.bench.table3 import TABLE3
from warpbrain.cases.shipped import find_case
from warpbrain.mesh import TetMesh
from warpbrain.simulation import assembly
from warpbrain.simulation.system import System

BODIES = 3


def arrays_in(mesh: TetMesh) -> list[np.ndarray]:
    return [mesh.points, mesh.tetrahedra, mesh.tissue, *mesh.node_sets.values(), *mesh.element_sets.values()]


def caches_by_mesh() -> dict[str, functools._lru_cache_wrapper]:
    """Every function of the package whose answers are kept by a mesh or by bytes, whoever wrote it and when."""
    found = {}
    for name, module in list(sys.modules.items()):
        if not name.startswith("warpbrain."):
            continue
        for member in vars(module).values():
            if isinstance(member, functools._lru_cache_wrapper):
                asked = [str(parameter.annotation) for parameter in inspect.signature(member).parameters.values()]
                if any(word in text for text in asked for word in ("Mesh", "bytes")):
                    found[f"{member.__module__}.{member.__qualname__}"] = member
    return found


@pytest.fixture
def case():
    return find_case(TABLE3["st/coarse"].case, TABLE3["st/coarse"].tissue)


def test_every_repetition_makes_everything_again(monkeypatch, case):
    meshes: list[TetMesh] = []
    patterns: list[int] = []
    systems: list[System] = []
    check, build, begin = TetMesh.__post_init__, assembly.build_pattern, System.__init__

    def checked(self):
        check(self)
        meshes.append(self)

    def built(stencils, count):
        patterns.append(count)
        return build(stencils, count)

    def begun(self, model, *rest):
        # the mesh was made in this repetition, and nothing of it is on a device
        assert model.mesh is meshes[-1] and len(meshes) == len(systems) + 1
        assert "assemblies" not in model.mesh.shared
        begin(self, model, *rest)
        systems.append(self)

    # everything of this mesh is warm before it begins
    device = "cpu"
    warm = measure.preprocess(case, fresh_arrays(case.mesh, 1), device, "double", 1e-6)
    again = System(warm.system.model, device)
    assert again.pairs is warm.system.pairs, "the bench guards against a cache that is there"

    monkeypatch.setattr(TetMesh, "__post_init__", checked)
    monkeypatch.setattr(assembly, "build_pattern", built)
    monkeypatch.setattr(System, "__init__", begun)
    hits = {name: cache.cache_info().hits for name, cache in caches_by_mesh().items()}
    assert "warpbrain.physics.regions._ball_weights" in hits, "caches by mesh are seen"
    preprocessing, capture, simulator = measure.measure_preprocessing(case, device, "double", 1e-6, BODIES)

    assert len(preprocessing) == len(capture) == len(systems) == BODIES
    assert min(preprocessing + capture) > 0.0
    assert simulator.system is systems[-1]
    assert len(meshes) == BODIES
    assert patterns == [len(case.mesh.points)] * BODIES
    assert hits == {name: cache.cache_info().hits for name, cache in caches_by_mesh().items()}
    for one, other in itertools.combinations([case.mesh, warm.system.mesh, *meshes], 2):
        for mine, theirs in itertools.product(arrays_in(one), arrays_in(other)):
            assert not np.shares_memory(mine, theirs)
    for one, other in itertools.combinations([warm.system, *systems], 2):
        for name in ("nodes", "inverse_edges", "pairs", "pair_positions", "contributions", "corners", "diagonal"):
            assert getattr(one, name).ptr != getattr(other, name).ptr, name
    # neither can a cache by content know them
    for system, number in zip(systems, range(1, BODIES + 1), strict=True):
        assert system.mesh.points.tobytes() == fresh_arrays(case.mesh, number)["points"].tobytes()
    for name in ("points", "tetrahedra"):
        assert len({getattr(mesh, name).tobytes() for mesh in (case.mesh, *meshes)}) == BODIES + 1


def test_a_fresh_mesh_is_of_the_same_body(case):
    fresh = case_of(case, fresh_arrays(case.mesh, 5))
    assert fresh.mesh.volume == pytest.approx(case.mesh.volume, rel=1e-12)
    # neighbours in memory stay neighbours: the elements are the same, from another first one on
    assert np.array_equal(np.roll(fresh.mesh.tetrahedra, -5, axis=0), case.mesh.tetrahedra)
    assert np.allclose(fresh.mesh.points - case.mesh.points, [5e-6, 0.0, 0.0], rtol=0.0, atol=1e-15)
    for name, members in case.mesh.node_sets.items():
        assert np.array_equal(fresh.mesh.node_sets[name], members)
    first = [measure.preprocess(c, fresh_arrays(c.mesh, 0), "cpu", "double", 1e-6) for c in (case, fresh)]
    for simulator in first:
        simulator.step()
    moved = [simulator.system.u.numpy() for simulator in first]
    # to the tolerance of the linear solves
    assert np.linalg.norm(moved[1] - moved[0]) < 1e-5 * np.linalg.norm(moved[0])


def test_sets_and_vectors_of_elements_turn_with_them():
    whole = cube(2)
    middle = whole.centres
    mesh = TetMesh(
        whole.points,
        whole.tetrahedra,
        np.arange(len(middle)),
        element_sets={"left": middle[:, 0] < 0.5},
        element_vectors={"middle": middle},
    )
    arrays = fresh_arrays(mesh, 7)
    fresh = TetMesh(**arrays)
    assert np.allclose(fresh.element_vectors["middle"] + [7e-6, 0.0, 0.0], fresh.centres, rtol=0.0, atol=1e-12)
    assert np.array_equal(fresh.element_sets["left"], fresh.element_vectors["middle"][:, 0] < 0.5)
    assert np.array_equal(np.roll(fresh.tissue, -7), mesh.tissue)
