"""Pictures of the generative model: a panel for every group, axes with units, whatever a user adds."""

import warnings
from dataclasses import replace

import matplotlib.image
import matplotlib.pyplot as plt
import numpy as np
import pytest

from warpbrain.gp.hierarchy import Hierarchical
from warpbrain.gp.literature.study import GROUPS, Study
from warpbrain.gp.trained import trained
from warpbrain.report import generative_pictures as page
from warpbrain.report.generative_pictures import draw_draws, draw_extrapolation, draw_studies

GREY, BRAIN = "hyperelastic/grey matter", "hyperelastic/brain"
MODELS = {"hierarchical": ("hierarchical", "corrected"), "coregionalised": ("coregionalised", "as_published")}


# the paper's model takes longer to draw, and is drawn by what every model has
@pytest.fixture(params=["hierarchical", pytest.param("coregionalised", marks=pytest.mark.slow(4))])
def models(request):
    """A model and another one to compare it with."""
    return trained(*MODELS[request.param]), trained(*next(MODELS[name] for name in MODELS if name != request.param))


def pictures(model, other, group=None):
    return draw_studies(model, group), draw_extrapolation(model, other, group), draw_draws(model, group)


def texts(figure):
    return [text.get_text() for text in figure.findobj(plt.Text) if text.get_text()]


def saved(figure, path):
    """Pixels of a figure that is written; nothing is said, and nothing stays behind."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        page.save(figure, path)
    assert [file.name for file in path.parent.iterdir()] == [path.name] and plt.get_fignums() == []
    return matplotlib.image.imread(path)


def test_every_group_has_its_panels(models):
    # the averages over hierarchies are those of the next test; one hierarchy has the same panels
    model, other = (replace(one, sample=()) if isinstance(one, Hierarchical) else one for one in models)
    for figure, each in zip(pictures(model, other), (1, 1, 2), strict=True):
        assert len(figure.axes) == each * len(GROUPS)
        titles = [axes.get_title() for axes in figure.axes if axes.get_title()]
        assert sorted(titles) == sorted(GROUPS)
        drawn = [axes for axes in figure.axes if axes.lines]
        assert len(drawn) == each * len(model.groups)
        empty = [axes for axes in figure.axes if not axes.lines]
        assert all([text.get_text() for text in axes.texts] == ["no study"] for axes in empty)
        for axes in drawn:
            assert axes.get_yscale() == "log" and np.all(np.isfinite(axes.get_ylim()))
            low, high = axes.get_ylim()
            assert any(low <= tick <= high for tick in axes.get_yticks()), axes.get_title()
        labels = [label for axes in figure.axes for label in (axes.get_xlabel(), axes.get_ylabel()) if label]
        assert labels.count("stretch") == 4
        assert all(label == "stretch" or label.endswith(" [Pa]") for label in labels)


@pytest.mark.slow(4)
def test_one_group(models, tmp_path):
    for figure, panels in zip(pictures(*models, BRAIN), (1, 1, 2), strict=True):
        assert len(figure.axes) == panels and figure.get_suptitle() == BRAIN
        assert all(axes.get_xlabel() == "stretch" and axes.get_ylabel().endswith(" [Pa]") for axes in figure.axes)
        image = saved(figure, tmp_path / "a.png")
        assert image.shape[1] == 2160
        assert image[..., :3].std() > 0.05


def test_the_studies_are_numbered_and_those_of_one_group_named():
    shown = texts(draw_studies(trained()))
    for study in trained().studies:
        assert str(study.number) in shown
    shown = texts(draw_studies(trained(), BRAIN))
    assert "52 Hyperelastic-OgdenMod1-Miller2002" in shown


def test_names_stand_apart():
    [axes] = draw_studies(trained(), "linear/brain").axes
    low, high = np.log(axes.get_ylim())
    places = np.sort([(np.log(text.get_position()[1]) - low) / (high - low) for text in axes.texts])
    assert len(places) == 16 and np.diff(places).min() > 0.03
    assert places[0] >= 0.0 and places[-1] <= 1.0


@pytest.mark.slow(3)
def test_a_users_study_of_any_name(tmp_path):
    model = trained()
    names = ("A study of " + "very " * 40 + "stiff tissue, $E_0$", "Études\nd'ailleurs 脳", "_")
    mine = (Study(name, GREY, "neo-hookean", {"mu": 1200.0}, {"mu": 1200.0}, (0.7, 1.6)) for name in names)
    added = Hierarchical((*model.studies, *mine), model.hierarchy)
    for index, group in enumerate((None, GREY)):
        figure = draw_studies(added, group)
        folder = tmp_path / str(index)
        folder.mkdir()
        saved(figure, folder / "a.png")
        panel = figure.axes[8] if group is None else figure.axes[0]
        # the panel is no narrower than what is written beside it
        assert panel.get_position().width > (0.1 if group is None else 0.4)
        assert panel.get_xlim() == (0.7, 1.6)


def test_a_group_that_the_other_model_has_not_seen():
    figure = draw_extrapolation(trained("coregionalised", "as_published"), trained(), "MRE/abnormal")
    assert len(figure.axes[0].collections) == 1


def test_the_papers_bands_explode_and_ours_stay():
    """The point of the picture: at twice the distance from rest of the studies, by decades."""
    ours, papers = trained(), trained("coregionalised", "as_published")
    at = np.array([0.7, 1.3])
    for group in ours.groups:
        wide = [model.curve(group, at, page.MOST) - model.curve(group, at, -page.MOST) for model in (ours, papers)]
        if group != BRAIN:
            assert np.all(wide[1] > 2.0 * wide[0]) and np.all(wide[0] < np.log(1e6))


def test_a_draw_is_in_the_picture_of_its_seed():
    lines = [
        {tuple(line.get_ydata()) for line in draw_draws(trained(), GREY, seed=seed).axes[0].lines} for seed in (0, 0, 1)
    ]
    assert lines[0] == lines[1] != lines[2]


def test_a_short_axis_has_numbers():
    from matplotlib.figure import Figure

    axes = Figure().subplots()
    for low, high in ((990.0, 1010.0), (300.0, 900.0), (300.0, 9e3), (1.0, 1e9)):
        page.logarithmic(axes, low, high)
        bottom, top = axes.get_ylim()
        assert bottom <= low and top >= high and top / bottom > 1.99
        assert sum(bottom <= tick <= top for tick in axes.get_yticks()) >= 2
