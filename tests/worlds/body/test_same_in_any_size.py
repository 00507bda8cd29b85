"""What is concluded does not depend on how large a body is: no length of a brain is believed of a gel or a specimen."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from sinking_block import write_sinking

from warpbrain.cases.case import Case
from warpbrain.diagnosis.diagnose import Diagnosing
from warpbrain.inference.calibration import calibration
from warpbrain.inference.decide import decide
from warpbrain.mesh import TetMesh
from warpbrain.physics.laws import NeoHookean
from warpbrain.recordings.base import Registration
from warpbrain.worlds.body.hypotheses import screened
from warpbrain.worlds.options import DiagnosisOptions

#: A specimen of millimetres for a body of centimetres.
SMALLER = 1.0 / 20.0


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> Case:
    """The block that sinks, its nodes off their lattice, so that no two places are alike."""
    case = write_sinking(Path(tmp_path_factory.mktemp("size")) / "case")
    mesh = case.mesh
    points = mesh.points + 5e-4 * np.random.default_rng(1).normal(size=mesh.points.shape)
    fitted = tuple(one for one in case.recordings if one.role == "fit")
    return replace(case, mesh=TetMesh(points, mesh.tetrahedra, mesh.tissue, mesh.node_sets, {}), recordings=fitted)


def scaled(case: Case, length: float, stiffness: float) -> Case:
    """The same body with lengths, and with a shear modulus, so many times as large; noise, too."""
    mesh, [beads] = case.mesh, case.recordings
    small = TetMesh(length * mesh.points, mesh.tetrahedra, mesh.tissue, mesh.node_sets, {})
    moved = replace(
        beads, points=length * beads.points, displacement=length * beads.displacement, sigma=length * beads.sigma
    )
    law = NeoHookean(stiffness * case.tissues[1].law.shear_modulus)
    registration = None
    if case.registration is not None:
        registration = Registration(length * case.registration.shift, case.registration.turn)
    tissues = {1: replace(case.tissues[1], law=law)}
    return replace(case, mesh=small, recordings=(moved,), tissues=tissues, registration=registration)


@pytest.mark.slow(6)
def test_loads_on_a_surface_are_as_probable(case: Case) -> None:
    """Of a body as stiff strains follow pressures, which are the same; registration is the one that is believed."""
    said, chances = [], []
    for one in (case, scaled(case, SMALLER, 1.0)):
        found = screened(one, "cpu", mesh_error=False, mechanisms=("contact", "inclusion", "pressure", "traction"))
        sets = found.weighted_sets
        chances.append(dict(zip((each.names for each in sets), found.probabilities.tolist(), strict=True)))
        said.append(decide([each.hypothesis for each in sets], found.probabilities, calibration().losses)[0])
    assert said[0] == said[1]
    assert chances[0].keys() == chances[1].keys()
    for names, chance in chances[0].items():
        assert chances[1][names] == pytest.approx(chance, abs=1e-3)


@pytest.mark.slow(6)
def test_a_weight_is_found_as_it_is(case: Case) -> None:
    """Of a softer body strains follow its weight; nothing fitted, scored or said has a size of its own."""
    case = replace(case, registration=Registration(5e-4, 0.01))
    options = DiagnosisOptions(candidates=("gravity", "swelling"), mesh_error=False)
    large, small = (Diagnosing(one, options, "cpu").run() for one in (case, scaled(case, SMALLER, SMALLER)))
    assert large.decision == small.decision and large.verdict == "named"
    assert small.p_value == pytest.approx(large.p_value, rel=1e-3)
    chances = [{one.causes: one.probability for one in each.combinations} for each in (large, small)]
    assert chances[1] == pytest.approx(chances[0], abs=1e-3)
    assert small.fit.explained[1] == pytest.approx(SMALLER * large.fit.explained[1], rel=1e-3)
    assert re.search(r"predicted to \d[.\d]* µm", small.sentence) and "0.00 mm" not in small.sentence
