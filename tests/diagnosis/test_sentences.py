"""Sentences of every verdict, of any numbers: with units, without names of parameters, never broken."""

import math
import re
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from warpbrain.diagnosis.result import Fit, effect_sentence, sentence_of
from warpbrain.inference import Kind
from warpbrain.inference.calibration import calibration
from warpbrain.inference.decide import VERDICTS, Decision
from warpbrain.physics.mechanisms import mechanisms
from warpbrain.physics.words import Smallest, Value
from warpbrain.worlds.body.causes import SENTENCES
from warpbrain.worlds.verdict import Ranked, Words, verdict_in_words

#: What each verdict says, whatever its numbers.
SAID = {
    "nothing missing": "No missing physics is detected",
    "named": "held out",
    "group": "do not tell which",
    "named + rest": "be left, which this does not explain",
    "unknown": "none of the known mechanisms explains",
    "not physics": "It is not physics that is missing",
    "cannot say": "cannot say what",
}

sizes = st.floats(-1e6, 1e6, allow_subnormal=False)
spreads = st.one_of(st.floats(1e-9, 1e6), st.just(0.0))
chances = st.floats(0.0, 1.0)


@st.composite
def ranked(draw):
    kind = draw(st.sampled_from(sorted(mechanisms())))
    values = []
    known = mechanisms()[kind].parameters()
    for name, spec in known.items():
        if spec.kind in ("number", "numbers"):
            values.append(Value(name, draw(sizes), draw(spreads), spec.unit))
        elif spec.kind in ("vector", "position"):
            unit = spec.unit if spec.kind == "vector" else "m"
            values += [Value(f"{name}_{part}", draw(sizes), draw(spreads), unit) for part in ("x", "z", "size")]
    if draw(st.booleans()):
        values.append(Value("share", draw(sizes), draw(spreads), ""))
    placed = draw(st.booleans())
    centre = np.array([draw(st.floats(-0.1, 0.1)) for _ in range(3)]) if placed else None
    radius = draw(st.floats(1e-3, 0.1)) if placed else None
    region = draw(st.sampled_from(["", "all tissue", "ventricle"]))
    return Ranked(kind, True, 0.0, draw(chances), 1.0, None, tuple(values), centre, radius, region)


@st.composite
def smallest(draw):
    kind = draw(st.sampled_from(sorted(mechanisms())))
    names = [name for name, spec in mechanisms()[kind].parameters().items() if spec.kind == "number"]
    name = draw(st.sampled_from([*names, "share"]))
    unit = "" if name == "share" else mechanisms()[kind].parameters()[name].unit
    size = draw(st.one_of(st.floats(0.0, 1e9), st.just(math.inf)))
    return kind, draw(st.sampled_from([Smallest(size, unit, name), Smallest(size, "of being there", "share")]))


def check(text):
    assert not re.search(r"\b(nan|inf|None)\b", text), text
    assert "_" not in text and not re.search(r"\b(share|csf|value|moduli|k1|k2)\b", text), text
    # every spread has a unit or is of a number that counts something: no double space, no space before a stop
    assert not re.search(r"  | [.,;:]|\.\.|\( | \)|\[\]", text), text
    assert re.search(r"[A-Z].*\.$", text, re.S), text


# to shrink a broken sentence takes minutes, and says no more than the sentence
@settings(max_examples=25, phases=(Phase.explicit, Phase.generate))
@given(st.data())
@pytest.mark.parametrize("verdict", VERDICTS)
def test_every_verdict_is_said(verdict, data):
    ranking = tuple(data.draw(st.lists(ranked(), min_size=3, max_size=4, unique_by=lambda one: one.kind)))
    kinds = {
        "named": (ranking[0].kind,),
        "named + rest": (ranking[0].kind,),
        "group": (ranking[0].kind, ranking[1].kind),
        "cannot say": (ranking[0].kind, ranking[1].kind),
        "not physics": (data.draw(st.sampled_from(sorted(SENTENCES))),),
    }.get(verdict, ())
    errors = [data.draw(st.floats(0.0, 0.1)) for _ in range(2)]
    explained = (errors[1], errors[1]) if verdict.startswith("named") else None
    fit = Fit((0.1, 0.1), (errors[0], errors[0]), explained, None, None, None, None)
    seen = dict(data.draw(st.lists(smallest(), max_size=5)))
    axis = data.draw(st.sampled_from([None, (0.0, 0.0, -1.0), (0.0, -2.0, 0.0)]))
    several = data.draw(st.integers(1, 3)) if verdict.startswith("named") else 0
    found = SimpleNamespace(
        verdict=verdict,
        decision=Decision(verdict, kinds),
        doubts=data.draw(st.sampled_from([(), ("gravity is not named: patterns that mean nothing predict as well.",)])),
        named=ranking[:several],
        group=() if several else kinds,
        ranking=ranking,
        p_value=data.draw(st.sampled_from([0.02, 1.0])) if verdict == "cannot say" else 0.02,
        p_left=data.draw(st.sampled_from([None, 0.02, 0.5])),
        alpha=0.05,
        combinations=[
            SimpleNamespace(causes=(), kinds=(), probability=data.draw(chances)),
            SimpleNamespace(causes=("unknown",), kinds=(Kind.UNKNOWN,), probability=data.draw(chances)),
        ],
        smallest=seen,
        fit=fit,
        unknown=None,
        case=SimpleNamespace(gravity_axis=axis),
    )
    text = sentence_of(found)
    check(text)
    assert SAID[verdict].replace("be left", "is left" if found.p_left == 0.02 else "may be left") in text
    assert ("contradict that" in text) == (verdict == "nothing missing")
    for kind in kinds[: 0 if verdict == "cannot say" else 1]:
        said = mechanisms()[kind].sentence if kind in mechanisms() else SENTENCES[kind]
        # within another sentence it begins with a small letter
        assert said[1:].rstrip(".") in text


def judged(decision, p_value, kinds, chance):
    """A verdict, and one set of causes of these kinds with its probability."""
    sets = [SimpleNamespace(causes=kinds, kinds=kinds, probability=chance)]
    return SimpleNamespace(decision=decision, p_value=p_value, alpha=0.05, smallest={}, combinations=sets, doubts=())


@pytest.mark.parametrize(
    ("nothing", "chance"), [(0.001, f"below {1.0 - calibration().most_said:.0%}".replace("%", " %")), (0.4, "40 %")]
)
def test_a_p_value_that_sees_nothing_is_no_reason_for_something_missing(nothing, chance):
    words = Words("these data", "", "", [], "", [], ["tissue drains"])
    unseen = verdict_in_words(judged(Decision("cannot say", ("drainage",)), 1.0, (), nothing), words)
    check(unseen)
    assert unseen.startswith("Something may be missing, but these data cannot say what.")
    # what doubts is the posterior, and the p-value is said of data, not of a cause
    assert f"The posterior probability that nothing is missing is {chance}," in unseen
    assert "yet these data do not contradict it (p = 1)." in unseen and "missing (p" not in unseen
    seen = verdict_in_words(judged(Decision("cannot say", ("drainage",)), 0.01, (), nothing), words)
    assert seen.startswith(f"Something {'is' if nothing < 0.1 else 'may be'} missing (p = 0.01), but these data")


@pytest.mark.parametrize("chance", [0.02, 0.31])
def test_physics_beside_an_error_is_not_denied(chance):
    words = Words("these data", "", "", [], "", [("Moduli are wrong.", 0.9)], [])
    said = verdict_in_words(judged(Decision("not physics", ("stiffness",)), 0.01, (Kind.PHYSICS,), chance), words)
    check(said)
    assert said.startswith("It is not physics that is missing") and "Moduli are wrong." in said
    assert ("beside it has a probability of 31 %" in said) == ("as far as these data tell" in said) == (chance > 0.1)


def one(kind, *values, **more):
    where = {"centre": None, "radius": None, "region": "", **more}
    return Ranked(kind, True, 0.0, 0.97, 9.0, None, tuple(Value(*v) for v in values), **where)


def test_gravity_has_a_level_in_millimetres_and_a_tilt_in_degrees():
    found = one(
        "gravity",
        ("share", 1.045, 0.064, ""),
        ("csf_level", 138.2, 6.0, "mm"),
        ("direction_x", math.sin(math.radians(5.0)), math.radians(1.0), ""),
    )
    text = effect_sentence(found, (0.0, 0.0, -1.0))
    assert "the fluid's surface is 138 ± 6 mm above the lowest point" in text
    assert "104 ± 6 % of that weight acts, towards inferior" in text
    assert "tilted by 5.0 ± 1.0 degrees towards right" in text


@pytest.mark.parametrize(
    ("found", "said"),
    [
        (one("swelling", ("amount", -5.37, 0.34, "%")), "it shrinks by 5.4 ± 0.3 % of its volume"),
        (one("swelling", ("amount", 3.1, 0.12, "%")), "it swells by 3.10 ± 0.12 % of its volume"),
        (one("inclusion", ("ratio", 2.6, 0.4, "")), "it is 2.6 ± 0.4 times as stiff as the tissue around"),
        (one("inclusion", ("ratio", 0.25, 0.025, "")), "it is 4.0 ± 0.4 times as soft as the tissue around"),
        (one("viscoelasticity", ("moduli", 1.16, 0.06, "")), "at first it is 2.16 ± 0.06 times as stiff as in the end"),
        (one("viscoelasticity", ("times", 40.0, 5.0, "s")), "its relaxation time is 40 ± 5 s"),
        (one("viscoelasticity", ("times", 4.6, 18.0, "s")), "is of the order of 5 s, which these data hardly tell"),
        (
            one(
                "viscoelasticity",
                *(("moduli_1", 0.115, 0.04, ""), ("moduli_2", 0.107, 0.05, "")),
                *(("times_1", 7.1, 3.0, "s"), ("times_2", 35.4, 60.0, "s")),
            ),
            "what relaxes, as a part of that in the end, is 0.12 ± 0.04 within 7 ± 3 s, "
            "and 0.11 ± 0.05 within the order of 35 s, which these data hardly tell",
        ),
        (one("pressure", ("value", -480.0, 20.0, "Pa")), "it is 480 ± 20 Pa lower there than elsewhere"),
        (one("traction", ("value_size", 2130.0, 50.0, "Pa")), "it acts with 2.13 ± 0.05 kPa"),
        (one("fibres", ("stiffness", 260.0, 40.0, "Pa")), "their stiffness is 260 ± 40 Pa"),
        (
            one("asymmetry", ("exponent", -17.0, 3.0, "")),
            "tension: Ogden's exponent is -17 ± 3: it resists",
        ),
        (one("compressibility", ("poisson", 0.425, 0.016, "")), "its Poisson ratio at rest is 0.425 ± 0.016"),
        (one("falx", ("thickness", 1.2, 0.3, "mm")), "its thickness is 1.2 ± 0.3 mm"),
        (
            one("inclusion", ("ratio", 2.6, 0.4, ""), centre=np.array([0.01, -0.02, 0.0]), radius=0.018),
            "It lies about (10, -20, 0) mm, within 18 mm.",
        ),
        (
            one("inclusion", ("ratio", 2.6, 0.4, ""), centre=np.array([0.00123, -0.002, 0.0]), radius=0.00052),
            "It lies about (1.2, -2.0, 0.0) mm, within 0.5 mm.",
        ),
    ],
)
def test_sizes_in_words(found, said):
    assert said in effect_sentence(found)
