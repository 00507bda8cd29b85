"""Trained models: those that ship, and those that are written and read again."""

import json

import numpy as np
import pytest

from warpbrain.errors import InputError
from warpbrain.gp.literature.studies import VARIANTS
from warpbrain.gp.literature.study import GROUPS
from warpbrain.gp.trained import KINDS, MODEL, STUDIES, find_model, fit_model, read_model, trained, write_model

ADDED = '[[study]]\nname = "Lab-GM-Someone2026"\ngroup = "hyperelastic/grey matter"\nmu = 12000.0\n'


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("variant", VARIANTS)
def test_what_ships(kind, variant):
    model = trained(kind, variant)
    assert (model.name, model.variant) == (kind, variant)
    assert len(model.studies) == {"as_published": 73, "corrected": 72}[variant]
    expected = [group for group in GROUPS if variant == "as_published" or group != "MRE/abnormal"]
    assert list(model.groups) == expected
    for group in model.groups:
        assert np.isfinite(model.curve(group, np.linspace(0.9, 1.1, 7), 2.0)).all()
    assert trained(kind, variant) is model
    assert find_model(kind, variant) is model


@pytest.mark.parametrize("kind", KINDS)
def test_written_and_read_again(kind, tmp_path):
    model = trained(kind, "corrected")
    write_model(tmp_path, model, {"objective": 1.0})
    again = read_model(tmp_path)
    stretches = np.linspace(0.8, 1.2, 5)
    np.testing.assert_array_equal(again.curve(GROUPS[8], stretches, 1.0), model.curve(GROUPS[8], stretches, 1.0))
    assert json.loads((tmp_path / MODEL).read_text())["training"] == {"objective": 1.0}
    assert sorted(path.name for path in tmp_path.iterdir()) == [MODEL]


@pytest.mark.slow(2)
def test_a_hierarchical_model_of_the_first_format_is_fitted_again(tmp_path):
    """Its effects meant other things; what it learnt from is the same."""
    table = {"kind": "hierarchical", "variant": "corrected", "kernel": "matern52", "parameters": {"paper": 0.65}}
    (tmp_path / MODEL).write_text(json.dumps(table))
    with pytest.warns(UserWarning, match="of an older format, without a mean asymmetry: fitted again"):
        model = read_model(tmp_path)
    at = np.array([0.95, 1.05])
    # the optimum is flat: processors that round otherwise end up to 2 % apart
    np.testing.assert_allclose(model.curve(GROUPS[8], at), trained().curve(GROUPS[8], at), rtol=0.05)


@pytest.mark.slow(3)
def test_a_study_of_three_lines_moves_its_group_and_goes_with_the_model(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text(ADDED)
    model, record = fit_model(add=file)
    assert record["converged"] and record["studies"] == 73 and "gp fit" in record["command"]
    at = np.array([0.95])
    before, after = (m.curve("hyperelastic/grey matter", at)[0] for m in (trained(), model))
    assert before < after < np.log(12000.0)
    folder = tmp_path / "model"
    folder.mkdir()
    write_model(folder, model, record, file)
    file.unlink()
    assert (folder / STUDIES).read_text() == ADDED
    again = find_model(folder)
    assert again.studies[-1].name == "Lab-GM-Someone2026" and again.studies[-1].paper == "Someone2026"
    assert again.curve("hyperelastic/grey matter", at)[0] == after


def test_a_model_that_does_not_exist():
    with pytest.raises(InputError, match="kind 'deep': expected one of hierarchical, coregionalised"):
        trained("deep")
    with pytest.raises(InputError, match="variant 'new': expected one of as_published, corrected"):
        trained("hierarchical", "new")
    with pytest.raises(InputError, match="nowhere: no such generative model: expected hierarchical"):
        find_model("nowhere")


@pytest.mark.parametrize(
    ("kind", "change", "expected"),
    [
        ("hierarchical", {"kind": "deep"}, "kind = 'deep': expected one of hierarchical"),
        ("hierarchical", {"variant": None}, "variant = None: expected one of as_published"),
        ("hierarchical", {"kernel": "cubic"}, "kernel = 'cubic': expected one of matern12"),
        ("hierarchical", {"parameters": 3}, "parameters: expected a table"),
        ("hierarchical", {"paper": -1.0}, "paper = -1.0: expected a positive number"),
        ("hierarchical", {"format": 3}, "format = 3: expected one of 1, 2"),
        ("hierarchical", {"sample": 3}, "sample: expected tables of parameters"),
        ("hierarchical", {"sample": [{}]}, "method = None: expected a positive number"),
        ("hierarchical", {"length scale": "long"}, "length scale = 'long': expected a positive number"),
        ("coregionalised", {"w": [1.0]}, "w: expected 12 finite numbers"),
        ("coregionalised", {"noise": [0.0] * 12}, "parameters: noise: expected positive numbers"),
        ("coregionalised", {"jitter": None}, "jitter = None: expected a positive number"),
        ("coregionalised", {"length scale": -1.0}, "^[^:]*: parameters: length scale = -1.0: expected a positive"),
    ],
)
def test_a_file_that_is_wrong(kind, change, expected, tmp_path):
    write_model(tmp_path, trained(kind), {})
    table = json.loads((tmp_path / MODEL).read_text())
    for key, value in change.items():
        (table if key in table else table["parameters"])[key] = value
    (tmp_path / MODEL).write_text(json.dumps(table))
    with pytest.raises(InputError, match=expected) as caught:
        read_model(tmp_path)
    assert str(tmp_path / MODEL) in str(caught.value)


@pytest.mark.parametrize(
    ("text", "expected"),
    [("{", "not JSON"), ("[" * 100_000, "not JSON"), ("[]", "found list, expected a table"), (None, "read")],
)
def test_a_file_that_is_not_one(text, expected, tmp_path):
    if text is not None:
        (tmp_path / MODEL).write_text(text)
    with pytest.raises(InputError, match=expected):
        read_model(tmp_path)


def test_broken_studies_beside_a_model(tmp_path):
    write_model(tmp_path, trained(), {})
    (tmp_path / STUDIES).write_text('[[study]]\nname = "x"\n')
    with pytest.raises(InputError, match=r"studies\.toml"):
        read_model(tmp_path)


def test_a_study_that_bears_the_name_of_no_paper_is_its_own():
    from warpbrain.gp.literature.studies import read_studies

    papers = {study.name: study.paper for study in read_studies("corrected")}
    assert papers["MRE-WM-Kruse1999"] == papers["MRE-GM-Kruse1999"] == "Kruse1999"
    assert len(set(papers.values())) == 30
