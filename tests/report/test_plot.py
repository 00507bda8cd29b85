"""`warpbrain.plot` and the tables of notebooks: every kind of result is drawn and told."""

from dataclasses import replace
from html import unescape

import numpy as np
import pytest
from folders import write_folder, write_recorded
from testing_machine import CUBE, case_of, recorded

import warpbrain as wb
from warpbrain.ensemble.sample import Sample
from warpbrain.physics.laws import NeoHookean
from warpbrain.simulation.model import Material


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    return wb.read_case(write_recorded(tmp_path_factory.mktemp("block")))


@pytest.fixture(scope="module")
def done(case):
    return wb.run(case, device="cpu")


@pytest.fixture(scope="module")
def spread(tmp_path_factory):
    case = wb.read_case(write_folder(tmp_path_factory.mktemp("block")))
    samples = [
        Sample(number, {label: Material(NeoHookean(mu)) for label in (1, 2)})
        for number, mu in enumerate((2000.0, 4000.0, 8000.0))
    ]
    return wb.ensemble(case, samples, device="cpu")


def test_the_grid_is_what_is_written(done):
    grid = wb.grid(done)
    np.testing.assert_allclose(grid.point_data["displacement"], 1000.0 * done.u)
    np.testing.assert_allclose(grid.points, 1000.0 * done.mesh.points)
    assert {"von_mises", "J", "tissue"} <= set(grid.cell_data)


def test_a_body_is_drawn_where_it_moves_to(done):
    plotter = done.plot(show=False, cut=None, exaggeration=3.0, field="von_mises")
    actor = next(actor for actor in plotter.actors.values() if hasattr(actor, "mapper"))
    moved = 1000.0 * (done.mesh.points + 3.0 * done.u)
    np.testing.assert_allclose(actor.mapper.dataset.bounds[::2], moved.min(axis=0), atol=1e-3)
    assert next(iter(plotter.scalar_bars.keys())).startswith("von Mises stress")
    plotter.close()


@pytest.mark.parametrize("wrong", [{"field": "stress"}, {"cut": "w"}])
def test_what_cannot_be_drawn_is_refused(done, wrong):
    with pytest.raises(wb.InputError, match=next(iter(wrong))):
        done.plot(show=False, **wrong)


def test_an_ensemble_is_drawn_by_its_deviation(spread):
    grid = wb.grid(spread)
    assert grid.point_data["displacement_sd"].shape == (len(spread.fields.mesh.points), 3)
    spread.plot(show=False).close()
    assert "3 done, 0 failed" in spread._repr_html_()


def test_a_case_and_its_tables(case, done):
    case.plot(show=False).close()
    assert "A block of gel" in case._repr_html_()
    told = done._repr_html_()
    assert "beads" in told and "left out" in told
    assert "von Mises" in done.result._repr_html_()


def test_tests_of_a_specimen_are_curves():
    case = replace(case_of(CUBE), recordings=(recorded("axial", [0.0, -2e-4, -4e-4], [0.0, -0.001, -0.002]),))
    tested = wb.run(case, device="cpu")
    assert len(tested.plot().axes) == 1
    assert "cycle 1" in tested._repr_html_() and "R²" in tested._repr_html_()


def test_a_diagnosis_is_drawn_by_where(small_diagnosis):
    assert "score" in wb.grid(small_diagnosis).point_data
    told = small_diagnosis._repr_html_()
    assert small_diagnosis.sentence in unescape(told) and "probability" in told


def test_text_of_a_user_is_no_markup(case):
    assert "&lt;b&gt;" in replace(case, title="<b>")._repr_html_()
