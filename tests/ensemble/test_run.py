"""`warpbrain.ensemble(...)`: samples on their own, kept in a folder or not, from one call."""

import numpy as np
import pytest
from folders import write_folder

import warpbrain as wb
from warpbrain.ensemble.sample import Sample
from warpbrain.physics.laws import NeoHookean
from warpbrain.simulation.model import Material

MODULI = (2000.0, 4000.0, 8000.0)


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    return wb.read_case(write_folder(tmp_path_factory.mktemp("block")))


SAMPLES = [Sample(number, {label: Material(NeoHookean(mu)) for label in (1, 2)}) for number, mu in enumerate(MODULI)]


def test_each_sample_is_its_run(case):
    spread = wb.ensemble(case, SAMPLES, device="cpu")
    assert len(spread.done) == 3
    sizes = []
    for mu in MODULI:
        alone = wb.run(case.with_shear_moduli({1: mu, 2: mu}), device="cpu", elements="tet4")
        sizes.append(np.linalg.norm(alone.u, axis=1).mean())
    found = [row.displacement["all nodes"].mean for row in spread.rows]
    np.testing.assert_allclose(found, sizes, rtol=1e-5)


def test_what_a_folder_has_is_not_computed_again(case, tmp_path, monkeypatch):
    first = wb.ensemble(case, SAMPLES, device="cpu", folder=tmp_path / "kept")
    from warpbrain.ensemble import workers

    def fail(*_):
        raise AssertionError("computed again")

    monkeypatch.setattr(workers.Here, "outcomes", fail)
    again = wb.ensemble(case, SAMPLES, device="cpu", folder=tmp_path / "kept")
    np.testing.assert_array_equal(first.fields.components.mean, again.fields.components.mean)


def test_a_specimen_has_no_ensemble():
    from testing_machine import CUBE, case_of

    with pytest.raises(wb.InputError, match="tests are run one by one"):
        wb.ensemble(case_of(CUBE), 2)
