"""A state beside the recordings of its case: nothing left of what it would have recorded itself."""

from dataclasses import replace

import numpy as np
import pytest
from folders import write_folder, write_recorded

from warpbrain.cases.reading import read_case
from warpbrain.recordings.recording import ForceRecording, PointsRecording, SurfaceRecording
from warpbrain.simulation.equilibrium import solve_equilibrium
from warpbrain.simulation.observation import observe
from warpbrain.simulation.of_case import model_of
from warpbrain.simulation.result import nodal_state_of, result_of
from warpbrain.simulation.system import System


@pytest.fixture(scope="module", params=["tet4", "tet10"])
def solved(request, tmp_path_factory):
    case = read_case(write_recorded(tmp_path_factory.mktemp("case")))
    system = System(replace(model_of(case), elements=request.param), "cpu")
    solve_equilibrium(system)
    return case, nodal_state_of(system)


def recorded(case, result, **more):
    """The case with recordings that hold what the result says."""
    top = result.mesh.node_sets["top"]
    points = PointsRecording(name="beads", file="", points=result.mesh.points[top], displacement=result.u[top], **more)
    surface = SurfaceRecording(name="lid", file="", points=(result.mesh.points + result.u)[top], nodes="top")
    force = ForceRecording(
        name="cell",
        file="",
        boundary="table",
        time=np.array([0.0, 1.0]),
        force=np.array([[0, 0, 0], [-0.01, -0.02, 0.05]]),
    )
    return replace(case, recordings=(points, surface, force))


def test_what_it_would_have_recorded_leaves_nothing(solved):
    case, result = solved
    observed = observe(recorded(case, result), result)
    assert observed.skipped == ()
    points, surface, force = observed.comparisons
    sizes = np.linalg.norm(result.u[result.mesh.node_sets["top"]], axis=1)
    assert points.before.root_mean_square == pytest.approx(np.sqrt(np.mean(sizes**2)))
    assert points.after.root_mean_square < 1e-15
    assert surface.after.root_mean_square < 1e-15 and surface.reverse_after.root_mean_square < 1e-15
    assert surface.before.root_mean_square > 1e-4
    # the table carries what presses on the top
    assert force.before.root_mean_square == pytest.approx(np.linalg.norm([0.01, 0.02, 0.05]))
    assert force.after.root_mean_square < 1e-8


def test_a_force_s_own_boundary_acts_with_that_force(solved):
    case, result = solved
    recording = replace(
        recorded(case, result).recordings[2], boundary="press", force=np.array([[0, 0, 0], [0.01, 0.02, -0.05]])
    )
    [force] = observe(replace(case, recordings=(recording,)), result).comparisons
    assert force.after.root_mean_square < 1e-15


def test_what_was_not_recorded_then_is_skipped_with_the_reason(solved):
    case, result = solved
    observed = observe(recorded(case, result), result, time=7.0)
    assert [c.name for c in observed.comparisons] == ["beads", "lid"]
    assert observed.skipped == ("recording 'cell' has nothing at 7 s: its times are 0 s to 1 s",)


def test_what_holds_a_body_carries_the_loads_on_held_nodes_too(tmp_path):
    """The base of a block under its own weight carries all of it, the share of the held nodes included."""
    gravity = '[[mechanism]]\nkind = "gravity"\ncsf_level = -50.0\n[body]'
    axis = 'axes = "RAS"\ngravity_axis = [0, 0, -1]'
    case = read_case(write_folder(tmp_path, ("[body]", gravity), ('axes = "RAS"', axis), ("-0.05]", "-1e-9]")))
    system = System(model_of(case), "cpu")
    solve_equilibrium(system)
    result = result_of(system)
    # all of it lies above the fluid: the buoyancy that it lost
    expected = np.array([-0.01, -0.02, 1007.0 * 9.81 * case.mesh.volume])
    np.testing.assert_allclose(result.reactions.sum(axis=0), expected, rtol=1e-6)
