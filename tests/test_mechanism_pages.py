"""The pages of the mechanisms are those of the code, and their pictures of the files as they are."""

import csv
import io
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest
from mechanism_pages import (
    Effect,
    digest_of,
    index,
    made_from,
    page,
    pairs_page,
    pairs_table,
    read_costs,
    read_effects,
    reasons,
    row_of,
    table,
    write_effects,
)
from mechanism_pairs import potential
from mechanism_picture import write_picture

from warpbrain.bench.mechanisms import BASE, PLAIN
from warpbrain.cases.assuming import assume
from warpbrain.cases.shipped import find_case
from warpbrain.physics.mechanisms import mechanisms
from warpbrain.physics.potential import Enters

DOCS = Path(__file__).parents[1] / "docs"
PAGES, FIGURES = DOCS / "mechanisms", DOCS / "figures"
EFFECTS = read_effects(PAGES / "effects.json")
COSTS = read_costs(sorted((DOCS.parent / "bench" / "results").glob("mechanisms_*.json")))
MAKE = "run python docs/make_mechanisms.py"


@pytest.mark.parametrize("kind", mechanisms())
def test_a_page_has_not_drifted(kind):
    assert kind in EFFECTS, MAKE
    text = page(kind, EFFECTS[kind])
    assert (PAGES / f"{kind}.md").read_text(encoding="utf-8") == text, MAKE
    assert mechanisms()[kind].sentence in text and mechanisms()[kind].example in text
    for name in mechanisms()[kind].parameters():
        assert f"\n- `{name}`" in text


@pytest.mark.parametrize("kind", mechanisms())
def test_a_picture_is_of_the_present_files(kind):
    assert kind in EFFECTS, MAKE
    assert EFFECTS[kind].made_from == made_from(kind), MAKE
    assert EFFECTS[kind].picture == digest_of(FIGURES / f"mechanism-{kind}.png"), MAKE
    # it shows something, and what the colours can show
    assert 0.3 < EFFECTS[kind].largest < 3.0


def test_the_index_has_not_drifted_and_nothing_is_left_behind():
    text = (PAGES / "index.md").read_text(encoding="utf-8")
    assert text == index(EFFECTS, COSTS), MAKE
    costs = "\n".join([*table(COSTS, list(mechanisms())), ""])
    assert (PAGES / "cost.csv").read_text(encoding="utf-8") == costs, MAKE
    assert {path.stem for path in PAGES.glob("*.md")} == {"index", "pairs", *mechanisms()}
    assert {path.stem for path in FIGURES.glob("mechanism-*.png")} == {f"mechanism-{kind}" for kind in mechanisms()}
    assert set(EFFECTS) == set(mechanisms())


@pytest.mark.parametrize(
    ("places", "formula"),
    [
        ({"r": "moduli", "Psi_fibres": "energy"}, "sum V r [Psi(F) + Psi_fibres(F)]"),
        ({"g": "growth", "T": "tension"}, "sum V (1 + g) [Psi(F_e) + T(F_e)]"),
        ({"r": "moduli", "T": "tension"}, "sum V [r Psi(F) + T(F)]"),
    ],
)
def test_the_formula_of_a_total_potential(places, formula):
    assert potential([Enters(place, symbol) for symbol, place in places.items()]) == formula


def test_of_one_symbol_twice_each_has_a_number():
    assert potential([Enters("load", "f"), Enters("load", "f")]) == "sum V Psi(F) - f_1 . u - f_2 . u"


def test_the_table_of_pairs_has_not_drifted():
    assert (PAGES / "pairs.md").read_text(encoding="utf-8") == pairs_page(), MAKE
    assert (PAGES / "pairs.csv").read_text(encoding="utf-8") == pairs_table(), MAKE


def test_every_pair_is_in_the_table_with_what_it_means_or_why_not():
    kinds = list(mechanisms())
    [_, *rows] = csv.reader(io.StringIO(pairs_table()))
    assert len(rows) == len(kinds) * (len(kinds) + 1) // 2
    for first, second, formula, said in rows:
        assert formula or said.startswith("Refused"), (first, second)


@pytest.mark.parametrize("kind", mechanisms())
def test_every_mechanism_has_its_five_faces(kind):
    mechanism = mechanisms()[kind]
    assert mechanism.sentence.endswith(".")
    assert hasattr(mechanism, "example"), f"{kind}: say an example of it on {BASE}"
    assert set(mechanism.confused_with) <= {*mechanisms(), "drainage"}
    assert set(mechanism.together) <= set(mechanisms())
    for name, spec in mechanism.parameters().items():
        assert spec.doc.endswith("."), name
    assert assume(find_case(BASE), mechanism.example).mechanisms[-1].kind == kind


def test_effects_come_back(tmp_path):
    kinds = list(mechanisms())
    effects = {kind: Effect(1.5, (1.0, 2.0, -3.0), 50, "a", "b") for kind in reversed(kinds)}
    write_effects(tmp_path / "effects.json", effects)
    again = read_effects(tmp_path / "effects.json")
    assert again == effects and list(again) == kinds
    assert read_effects(tmp_path / "none.json") == {}
    assert digest_of(tmp_path / "none.json") == ""


def test_costs_in_words():
    kind, other = list(mechanisms())[:2]
    twice = {"plain": [10.0, 20.0, 30.0], "with": [20.0, 40.0, 45.0]}
    counts = {"plain": [4, 4], "with": [6, 6]}
    row = {"kind": kind, "example": mechanisms()[kind].example, "step": twice, "newton": twice}
    row |= {"cg_iterations": counts, "newton_iterations": counts}
    same = {**row, "kind": PLAIN, "step": {"plain": [1.0], "with": [1.0]}}
    costs = {"device": "a machine", "date": "2026-01-02", "rows": [same, row]}
    assert reasons([costs]) == []
    [long] = reasons([{**costs, "rows": [{**row, "example": "another", "step": {"plain": [1.0], "with": [6.0]}}]}])
    assert long == (
        f"- {kind}, a machine, 2026-01-02 (`another`): 6.0 times. The linear solver takes 6 iterations for 4, and 4.0 "
        "times as long for each."
    )
    assert row_of(costs, other) is None
    head, first, second, third = table([costs], [kind, other])
    assert head == ',"a machine, 2026-01-02: step","a machine, 2026-01-02: Newton iteration"'
    assert first == "plain beside plain,1.00,2.00"
    assert second == f"{kind},2.00,2.00"
    assert third == f"{other},,"


def test_the_picture_is_of_the_difference(tmp_path):
    """Colours on the side that moves, and the dark end of the scale on the other."""
    case = find_case(BASE)
    difference = np.zeros(case.mesh.points.shape)
    difference[case.mesh.points[:, 0] > 0.0, 2] = 0.003
    write_picture(tmp_path / "a.png", case, case.mesh, difference, "lifted")
    pixels = matplotlib.image.imread(tmp_path / "a.png")[..., :3]
    height, width = pixels.shape[:2]
    right = pixels[height // 4 : 3 * height // 4, width // 2 : int(0.9 * width)]
    middle = right.shape[1] // 2
    yellow = (right[..., 0] > 0.9) & (right[..., 1] > 0.8) & (right[..., 2] < 0.3)
    dark = (right[..., 0] < 0.35) & (right[..., 1] < 0.1) & (right[..., 2] < 0.45) & (right[..., 2] > 0.25)
    # the patient's right is on the left of the picture
    assert yellow[:, :middle].sum() > 10 * yellow[:, middle:].sum()
    assert dark[:, middle:].sum() > 10 * dark[:, :middle].sum()
