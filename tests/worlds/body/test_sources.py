"""What has no name and acts in one place."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import pytest
from drawn_for_commit import one_for_this_commit
from gel import block_of_gel, with_beads
from shapes import box

from warpbrain.cases.case import Case
from warpbrain.diagnosis.diagnose import diagnose
from warpbrain.diagnosis.result import sentence_of
from warpbrain.inference.decide import UNKNOWN
from warpbrain.mesh import TetMesh
from warpbrain.mesh.refinement import refined
from warpbrain.physics.load import Load
from warpbrain.simulation.equilibrium import EquilibriumSolver
from warpbrain.simulation.of_case import model_of
from warpbrain.simulation.system import System
from warpbrain.worlds.body.effects import Effects
from warpbrain.worlds.body.linearisation import Linearisation
from warpbrain.worlds.body.sources import Source
from warpbrain.worlds.body.unknown import declarable


@pytest.fixture(scope="module")
def at(small_diagnosis) -> Linearisation:
    return small_diagnosis.search.base.at


@pytest.fixture(scope="module")
def effects(small_diagnosis):
    base = small_diagnosis.search.base
    return [effect for effect in base.sources if effect.proposal is not None]


def _is_force(effect) -> bool:
    return not effect.proposed.make(np.zeros(6)).stress


def test_columns_of_a_scan_are_those_of_the_loads_that_fits_have(at, effects):
    """All places at once, and each of them as any other mechanism."""
    chosen = effects[:: len(effects) // 7]
    assert {_is_force(effect) for effect in chosen} == {True, False}
    for effect, again in zip(chosen, Effects(at).of([e.proposed for e in chosen]), strict=True):
        np.testing.assert_allclose(again.columns, effect.columns, atol=1e-9 * np.abs(effect.columns).max())
        assert not again.mean.any()


def test_they_move_what_is_recorded_as_far_as_its_noise(small_diagnosis, at, effects):
    """In the mean over the places of a scan, whatever the length."""
    rows, noise = at.sensors.is_displacement, small_diagnosis.search.base.typical_noise
    by_length: dict[float, list[float]] = {}
    for effect in effects:
        square = np.sum(effect.columns[rows] ** 2, axis=1).mean()
        by_length.setdefault(effect.proposed.radius, []).append(square)
    assert len(by_length) == 7
    for squares in by_length.values():
        np.testing.assert_allclose(np.sqrt(np.mean(squares)), noise, rtol=1e-9)


def test_the_longest_force_is_the_same_throughout(at, effects):
    """Or runs around an axis: with the angular velocity of a rigid body, whatever its centre."""
    mesh = at.system.model.mesh
    longest = max((effect for effect in effects if _is_force(effect)), key=lambda effect: effect.proposed.radius)
    away = mesh.points - mesh.points.mean(axis=0)
    motions = [*np.tile(np.eye(3)[:, None], (1, len(away), 1)), *np.cross(np.eye(3)[:, None], away)]
    answers = at.answers(mesh.node_volumes[:, None] * np.array(motions))
    for answer in answers.T:
        left = answer - longest.columns @ np.linalg.lstsq(longest.columns, answer, rcond=None)[0]
        assert np.linalg.norm(left) < 0.05 * np.linalg.norm(answer)


def test_a_force_has_its_resultant_and_a_stress_none(at):
    mesh = at.system.model.mesh
    centre = tuple(mesh.points.mean(axis=0).tolist())
    force, length = np.array([0.3, -0.2, 0.1]), 0.3 * mesh.radius
    nodal = Source(centre=centre, length=length, force=tuple(force)).nodal_forces(mesh)
    np.testing.assert_allclose(nodal.sum(axis=0), force, rtol=1e-12)
    nodal = Source(centre=centre, length=length, stress=(1.0, -2.0, 0.5, 3.0, 0.2, -1.0)).nodal_forces(mesh)
    size = np.abs(nodal).sum()
    np.testing.assert_allclose(nodal.sum(axis=0), 0.0, atol=1e-12 * size)
    np.testing.assert_allclose(np.cross(mesh.points, nodal).sum(axis=0), 0.0, atol=1e-12 * size * mesh.radius)


def test_a_turn_is_a_moment_about_its_axis():
    """Far from the surface, of a Gaussian of length L: `2 L` times it, since `E[x^2] = L^2` along each axis."""
    solid = box((16, 16, 16), (1.0, 1.0, 1.0))
    mesh = TetMesh(solid.points, solid.tetrahedra)
    turn, length = np.array([0.0, 0.7, 0.0]), 0.12
    nodal = Source(centre=(0.5, 0.5, 0.5), length=length, turn=tuple(turn)).nodal_forces(mesh)
    moment = np.cross(mesh.points - 0.5, nodal).sum(axis=0)
    np.testing.assert_allclose(moment, 2.0 * length * turn, atol=0.01 * length)
    np.testing.assert_allclose(nodal.sum(axis=0), 0.0, atol=1e-3)


def test_a_pressure_of_it_is_a_growth(at, effects):
    """In a body of one tissue both push alike, whatever the sizes."""
    mesh = at.system.model.mesh
    assert len(mesh.labels) == 1
    for effect in [effect for effect in effects if not _is_force(effect)][::20]:
        away = np.linalg.norm(mesh.centres - effect.proposed.centre, axis=1) / effect.proposed.radius
        [growth] = at.answers_of_elements(at.growth_forces, np.exp(-0.5 * away**2)[:, None]).T
        cosine = growth @ effect.columns[:, 5] / np.linalg.norm(growth) / np.linalg.norm(effect.columns[:, 5])
        assert abs(cosine) > 0.99


def test_elsewhere_it_is_in_the_same_unit(at, effects):
    proposal = effects[0].proposed
    other = proposal.elsewhere(proposal.centre, proposal.radius)
    np.testing.assert_array_equal(other.sd, proposal.sd)
    assert other.make(proposal.sd) == proposal.make(proposal.sd)


def test_no_case_can_declare_it(small_diagnosis):
    source = Source(centre=(0.0, 0.0, 0.0), length=0.01)
    assert declarable([source]) == ()
    from warpbrain.physics.mechanisms import mechanisms

    assert Source.kind not in mechanisms()


@dataclass(frozen=True, kw_only=True)
class Whirl(Load):
    """A body force that runs around an axis [N/m3], of a Gaussian of a length [m] about a centre."""

    centre: tuple[float, float, float]
    axis: tuple[float, float, float]
    length: float
    size: float
    kind: ClassVar[str] = "whirl"

    def nodal_forces(self, mesh):
        arm = (mesh.points - np.array(self.centre)) / self.length
        density = self.size * np.exp(-0.5 * np.sum(arm**2, axis=1))
        return np.asarray((mesh.node_volumes * density)[:, None] * np.cross(np.array(self.axis), arm))


@dataclass(frozen=True, kw_only=True)
class Sideways(Load):
    """The same body force everywhere [N/m3]."""

    density: tuple[float, float, float]
    kind: ClassVar[str] = "sideways"

    def nodal_forces(self, mesh):
        return np.asarray(mesh.node_volumes[:, None] * np.array(self.density))


def finer(case: Case) -> Case:
    """The case in elements of half the size: a body that is linear within the elements of a case does not exist."""
    return replace(case, mesh=refined(case.mesh)[0])


@pytest.mark.slow(10)
@pytest.mark.parametrize("density", one_for_this_commit([(3000.0, 0.0, 0.0), (0.0, -4000.0, 0.0)]))
def test_a_force_throughout_the_body_is_not_called_by_a_name(density):
    side, noise = 0.1, 3e-4
    case = block_of_gel((6, 6, 6), (side, side, side), axis=2, mu=1000.0, gravity_axis=(0.0, 0.0, -1.0))
    true = finer(case)
    u = EquilibriumSolver(System(model_of(true), "cpu")).solve(Sideways(density=density).nodal_forces(true.mesh)).u
    rng = np.random.default_rng(2)
    x = side * rng.uniform(0.03, 0.97, (60, 3))
    result = diagnose(with_beads(case, u, x, noise, rng, true.mesh), None, "cpu")
    assert result.decision.verdict == UNKNOWN
    assert "throughout the body" in sentence_of(result)
    # to the noise, each component of it; how large it is depends on how stiff tissue is, which no known load tells
    source = result.unknown.source
    assert source.error < 1.5 * np.sqrt(3.0) * noise < 0.5 * source.without
    cosine = source.force @ density / np.linalg.norm(source.force) / np.linalg.norm(density)
    assert cosine > 0.95


@pytest.mark.slow(10)
@pytest.mark.parametrize("size", one_for_this_commit([12e3, 40e3]))
def test_a_whirl_that_turns_tissue_far_is_not_called_by_a_name(size):
    """Linear about rest it is lost to a traction that a fit follows; a larger one looks like a field there."""
    side, noise = 0.1, 3e-4
    case = block_of_gel((7, 7, 7), (side, side, side), axis=2, mu=1000.0)
    true = finer(case)
    whirl = Whirl(centre=(0.03, 0.055, 0.07), axis=(0.0, 0.6, 0.8), length=0.022, size=size)
    u = EquilibriumSolver(System(model_of(true), "cpu")).solve(whirl.nodal_forces(true.mesh)).u
    assert np.linalg.norm(u, axis=1).max() > 0.08 * side
    rng = np.random.default_rng(1)
    x = side * rng.uniform(0.03, 0.97, (60, 3))
    result = diagnose(with_beads(case, u, x, noise, rng, true.mesh), None, "cpu")
    assert result.decision.verdict == UNKNOWN
    source = result.unknown.source
    assert source.turns and np.linalg.norm(source.centre - whirl.centre) < whirl.length
    assert 0.6 * whirl.length < source.length < 1.6 * whirl.length
    # to the noise, each component of it
    assert source.error < min(1.5 * np.sqrt(3.0) * noise, 0.5 * source.without)
    assert "a force that runs around an axis about" in sentence_of(result)
