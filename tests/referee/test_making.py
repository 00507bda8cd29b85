"""A case of every class on a small body: its folder reads back, and says nothing of what acts in it."""

from collections import Counter

import numpy as np
import pytest
from scipy.spatial.distance import pdist

from concealed.sealing import open_sealed, read_sealed
from referee import make
from referee.draw import MECHANISMS, OUTSIDE, TRAPS, draw_effect, trapped
from referee.equilibrium import NoTruth
from referee.labels import label_of
from referee.plan import SETS, Planned, planned
from referee.setting import draw_setting
from warpbrain.cases.reading import read_case
from warpbrain.physics.mechanisms import mechanisms

CLASSES = [
    Planned("none", (), "phantom"),
    *(Planned("effect", (name,), "phantom") for name in MECHANISMS),
    Planned("two", ("pressure", "inclusion"), "phantom"),
    *(Planned("outside", (name,), "phantom") for name in OUTSIDE),
    *(Planned("trap", (name,), "phantom") for name in TRAPS),
]


#: What differs most: nothing, something that is a load, that remembers, two, what has no name, and a trap.
MOST = ((), ("gravity",), ("viscoelasticity",), ("pressure", "inclusion"), ("uniform-force",), ("segmentation",))


@pytest.mark.parametrize(
    "plan",
    # most draws with contact have no truth
    [
        pytest.param(plan, marks=[] if plan.names in MOST else [pytest.mark.slow(6 if "contact" in plan.names else 1)])
        for plan in CLASSES
    ],
    ids=["-".join((plan.kind, *plan.names)) for plan in CLASSES],
)
def test_a_case_of_every_class(plan, small, tmp_path):
    make.make_case(tmp_path, "case-001", plan, [7, 1])
    case = read_case(tmp_path / "cases" / "case-001")
    assert not case.mechanisms
    assert [boundary.name for boundary in case.boundaries] == ["skull base", "side", "superior cap"]
    assert {r.role for r in case.recordings} == {"fit", "check"}
    label = open_sealed(read_sealed(tmp_path / "labels" / "case-001.json.gz"))
    assert label["kind"] == plan.kind and tuple(label["names"]) == plan.names
    assert label["forces_left"] < 1e-4
    assert len(label["effects"]) == (0 if plan.kind in ("none", "trap") else len(plan.names))
    if label["effects"]:
        assert 1.0 <= label["detectability"] <= 45.0
        assert label["rms_effect_m"] > 0.0 and label["upper"] > 0.0
        assert all(effect["wanted"] > 0.0 and effect["drawn_again"] >= 0 for effect in label["effects"])
    else:
        assert label["detectability"] == 0.0 and label["rms_effect_m"] == 0.0
    if plan.kind == "two":
        for effect in label["effects"]:
            assert 0.0 < effect["conditional"] <= 1.001 * effect["detectability"]
            assert np.shape(effect["clean_effect_m"]) == np.shape(label["clean_effect_m"])
    if "viscoelasticity" in plan.names:
        assert len(np.unique(case.recordings[0].time)) == 3
        # tissue that creeps is stiffer at first
        assert np.linalg.norm(label["clean_effect_m"][0]) > np.linalg.norm(label["clean_effect_m"][-1])


def test_where_no_draw_has_a_truth_loads_are_put_on_in_steps(small, tmp_path, monkeypatch):
    solved = make.solve_truth
    asked = []

    def hard(setting, wishes, until, steps):
        asked.append(steps)
        if steps == 1:
            raise NoTruth("too much at once")
        return solved(setting, wishes, until, steps)

    monkeypatch.setattr(make, "solve_truth", hard)
    make.make_case(tmp_path, "case-001", CLASSES[0], [7, 3])
    assert asked == make.ATTEMPTS * [1] + [4]
    assert len(open_sealed(read_sealed(tmp_path / "labels" / "case-001.json.gz"))["attempts"]) == make.ATTEMPTS


def test_recordings_are_the_truth_within_noise(small, tmp_path):
    make.make_case(tmp_path, "case-001", CLASSES[0], [7, 2])
    label = open_sealed(read_sealed(tmp_path / "labels" / "case-001.json.gz"))
    check = next(r for r in read_case(tmp_path / "cases" / "case-001").recordings if r.role == "check")
    true = np.array(label["check_displacement_m"]).reshape(-1, 3)
    off = np.sqrt(((check.displacement - true) ** 2).sum(axis=1).mean())
    # noise of half a millimetre or so, and errors of registration about as large
    assert 0.5 * label["check_noise_m"] < off < 5e-3
    np.testing.assert_allclose(check.points, np.tile(label["check_points_m"], (len(true) // 10, 1)), atol=1e-6)


def test_the_same_seed_makes_the_same_truth(small):
    truths = [make._draw(CLASSES[2], [3, 4, 0]) for _ in range(2)]
    labels = [label_of("x", CLASSES[2], truth, []) for truth in truths]
    assert labels[0] == labels[1]


def test_effects_have_the_tools_names():
    assert set(MECHANISMS) <= set(mechanisms())
    for name in MECHANISMS:
        parameter = next(c for c in _classes() if c.kind == name).parameter
        assert parameter == "" or parameter in mechanisms()[name].parameters()
    assert not set(OUTSIDE) & set(mechanisms())


def _classes():
    from referee import effects

    return [getattr(effects, name) for name in effects.__all__ if name != "Effect"]


def test_the_scored_set_is_what_was_announced():
    cases = planned("scored", SETS["scored"], ["phantom", "0603"], 1)
    assert Counter(case.kind for case in cases) == {"none": 32, "effect": 96, "two": 16, "outside": 8, "trap": 8}
    each = Counter(case.names[0] for case in cases if case.kind == "effect")
    assert each == dict.fromkeys(MECHANISMS, 12)
    assert {case.names[0] for case in cases if case.kind == "trap"} == set(TRAPS)
    assert {case.names[0] for case in cases if case.kind == "outside"} == set(OUTSIDE)


def test_calibration_has_something_of_everything():
    cases = planned("calibration", 80, ["phantom"], 1)
    assert Counter(case.kind for case in cases) == {"none": 30, "effect": 32, "two": 6, "outside": 6, "trap": 6}
    assert {case.names[0] for case in cases if case.kind == "effect"} == set(MECHANISMS)


def test_traps_have_nothing_else_and_as_many_of_each():
    cases = planned("traps", 60, ["phantom", "phantom", "0603"], 1)
    assert Counter(case.names for case in cases) == {(name,): 10 for name in TRAPS}
    assert {case.kind for case in cases} == {"trap"}
    # a trap is not of one body only, but for the mesh that there is of the phantom alone
    for name in set(TRAPS) - {"coarse"}:
        assert len({case.geometry for case in cases if case.names == (name,)}) == 2


def test_sets_of_pairs_and_of_what_has_no_name():
    cases = planned("pairs", SETS["pairs"], ["phantom", "phantom", "0603"], 1)
    assert len(cases) == 100 and {case.kind for case in cases} == {"two"}
    of_pair = Counter(frozenset(case.names) for case in cases)
    assert len(of_pair) == 28 and set(of_pair.values()) == {3, 4}
    cases = planned("unknown", SETS["unknown"], ["phantom", "phantom", "0603"], 1)
    assert len(cases) == 100 and {case.kind for case in cases} == {"outside"}
    assert set(Counter(case.names for case in cases).values()) == {14, 15}


def test_the_trap_of_registration_is_an_exact_rigid_motion(small):
    random = np.random.default_rng(0)
    setting = draw_setting(random, "phantom", False)
    points = small.points[::50]
    for _ in range(20):
        blur = trapped(random, "registration", setting).blur
        turned = points + blur.misaligned(points, np.zeros_like(points), points.mean(axis=0))
        assert 3e-3 <= np.linalg.norm(blur.shift) <= 8e-3
        assert 2.0 <= np.rad2deg(np.linalg.norm(blur.rotation)) <= 8.0
        np.testing.assert_allclose(pdist(turned), pdist(points), atol=1e-15)


def test_a_support_may_be_free_over_a_patch(small):
    random = np.random.default_rng(0)
    drawn = [draw_effect(random, "contact", draw_setting(random, "phantom", False)) for _ in range(20)]
    assert {effect.support for effect in drawn} == {"side", "fixed"}
    base = next(effect for effect in drawn if effect.support == "fixed").resized(0.03)
    problem = draw_setting(random, "phantom", False).problem()
    loose = problem.held[:, 0] & ~base.act(problem).held[:, 0]
    assert loose.any() and not (loose & ~small.nodes("fixed")).any()
    assert (np.linalg.norm(small.points[loose] - base.centre, axis=1) < 0.03).all()
    assert not loose[small.nodes("fixed")].all()


def test_a_seed_is_any_text():
    assert make.seed_of("a commit") == make.seed_of("a commit") != make.seed_of("another")


def test_a_case_that_never_converges_is_reported(small, tmp_path, monkeypatch):
    def fails(*_):
        raise make.NoTruth("no balance")

    monkeypatch.setattr(make, "solve_truth", fails)
    with pytest.raises(make.NoTruth, match="24 draws"):
        make.make_case(tmp_path, "case-001", CLASSES[0], [7, 1])
    assert not (tmp_path / "cases").exists()
