"""Specimens cut along and across the fibres: one direction of the tissue, several of the machine."""

from dataclasses import replace

import numpy as np
import pytest
from testing_machine import EXACT, case_of, recorded

from warpbrain.cases.reading import read_case
from warpbrain.cases.specimen import Specimen
from warpbrain.cases.writing import write_case
from warpbrain.errors import InputError
from warpbrain.physics.mechanisms.fibres import Fibres
from warpbrain.recordings.test import turn_of
from warpbrain.simulation.specimen import Rig
from warpbrain.worlds.options import DiagnosisOptions
from warpbrain.worlds.specimen.diagnose import DiagnosingSpecimen
from warpbrain.worlds.specimen.material import HomogeneousMaterial

ROD = Specimen("cylinder", (8e-3, 8e-3, 5e-3), "lubricated")
STRETCH = np.linspace(1.0, 1.2, 30)


def test_a_turn_is_a_rotation_that_lays_the_axis_along_the_machine():
    for axis, sheared in (((1.0, 2.0, 3.0), None), ((1.0, 0.0, 0.0), None), ((0.0, 1.0, 0.0), (1.0, 1.0, 0.0))):
        R = turn_of(axis, sheared)
        np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-14)
        assert np.linalg.det(R) == pytest.approx(1.0)
        np.testing.assert_allclose(R @ np.array(axis) / np.linalg.norm(axis), [0.0, 0.0, 1.0], atol=1e-14)
    np.testing.assert_array_equal(turn_of((0.0, 0.0, 1.0), None), np.eye(3))
    with pytest.raises(InputError, match="not along the axis"):
        turn_of((0.0, 0.0, 2.0), (0.0, 0.0, -1.0))


def test_a_test_across_the_tissue_is_one_of_turned_fibres():
    fibres = Fibres(direction=(1.0, 0.0, 0.0), stiffness=400.0, exponent=2.0)
    case = replace(case_of(ROD), mechanisms=(fibres,))
    along = replace(recorded("stretch", STRETCH), axis=(1.0, 0.0, 0.0))
    result = Rig(case, "cpu", options=EXACT).run(along, steps=3)
    turned = replace(case, mechanisms=(replace(fibres, direction=(0.0, 0.0, 1.0)),))
    reference = Rig(turned, "cpu", options=EXACT).run(recorded("stretch", STRETCH), steps=3)
    np.testing.assert_allclose(result.response, reference.response, rtol=1e-9, atol=1e-9)
    found = HomogeneousMaterial.of_case(case, (), along.turn).stress("axial", result.imposed, None)
    np.testing.assert_allclose(found, result.response, rtol=1e-5, atol=0.01)


def rods_with_fibres():
    fibres = Fibres(direction=(1.0, 0.0, 0.0), stiffness=900.0)
    case, rng, found = case_of(ROD), np.random.default_rng(4), []
    for name, axis in (("along", (1.0, 0.0, 0.0)), ("across", (0.0, 1.0, 0.0)), ("through", (0.0, 0.0, 1.0))):
        test = replace(recorded("stretch", STRETCH), axis=axis, name=name)
        stress = HomogeneousMaterial.of_case(case, (fibres,), test.turn).stress("axial", STRETCH, None)
        noise = 0.01 * np.abs(stress).max() * rng.normal(size=len(STRETCH))
        found.append(replace(test, response=stress + noise))
    return found


def test_fibres_are_told_by_one_mode_along_and_across_them(tmp_path):
    case = replace(case_of(ROD), recordings=tuple(rods_with_fibres()))
    write_case(tmp_path / "case", case)
    read = read_case(tmp_path / "case")
    assert [r.axis for r in read.recordings] == [r.axis for r in case.recordings]
    options = DiagnosisOptions(
        candidates=("fibres", "asymmetry", "stiffening", "second invariant", "drift of the zero")
    )
    found = DiagnosingSpecimen(read, options, "cpu").run()
    assert found.verdict == "named" and [one.kind for one in found.named] == ["fibres"]
    assert found.named[0].region == "fibres along x"
    [stiffness] = found.named[0].values
    assert abs(stiffness.value - 900.0) < 3.0 * stiffness.sd + 90.0
    assert found.explained is not None and found.explained.mechanisms[0].direction == (1.0, 0.0, 0.0)
