"""The rule: each of the seven verdicts, and what keeps a name from being spoken."""

from collections.abc import Mapping

import pytest

from warpbrain.diagnosis.result import (
    CANNOT_SAY,
    GROUP,
    NAMED,
    NAMED_AND_REST,
    NOT_PHYSICS,
    NOTHING,
    UNKNOWN,
    Ranked,
)
from warpbrain.diagnosis.verdict import Evidence, Verdict, decide, overall


def found(chances: Mapping[str, float], **known: object) -> Evidence:
    ranking = [
        Ranked(kind, kind not in ("unknown", "registration", "mesh"), 10.0, chance, 9.0, -1e-4, (), None, None, "")
        for kind, chance in chances.items()
    ]
    given = {
        "alpha": 0.05,
        "p_value": 0.001,
        "chance": known.get("p_value", 0.001),
        "ranking": ranking,
        "gain": 12.0,
        "sure": 5.0,
        "placebo_p": 0.01,
        "adequacy_p": 0.5,
        "needed": 1.0,
        "size": 1.0,
        "unknown_sure": 5.0,
        "aside": 0.04,
        "set_aside": 3,
    }
    return Evidence(**(given | known))


@pytest.mark.parametrize(
    ("chances", "known", "expected"),
    [
        ({"gravity": 1.0}, {"p_value": 0.3}, NOTHING),
        ({"gravity": 0.97, "pressure": 0.03}, {}, NAMED),
        ({"gravity": 0.97, "pressure": 0.03}, {"adequacy_p": 0.001}, NAMED_AND_REST),
        ({"gravity": 0.97, "pressure": 0.03}, {"adequacy_p": 0.001, "needed": 0.6}, CANNOT_SAY),
        ({"gravity": 0.7, "unknown": 0.3}, {"adequacy_p": 0.001}, UNKNOWN),
        # either, as it leaves nothing
        ({"gravity": 0.7, "unknown": 0.3}, {}, GROUP),
        ({"gravity": 0.7, "unknown": 0.3}, {"p_value": 0.03}, GROUP),
        ({"gravity": 0.7, "unknown": 0.3}, {"p_value": 0.03, "sure": 1.0}, CANNOT_SAY),
        ({"gravity": 0.7, "unknown": 0.3}, {"gain": -1.0}, CANNOT_SAY),
        ({"gravity": 0.7, "unknown": 0.2, "registration": 0.1}, {}, CANNOT_SAY),
        ({"gravity": 0.7, "unknown": 0.3}, {"adequacy_p": 0.001, "unknown_sure": -1.0}, CANNOT_SAY),
        ({"gravity": 0.6, "pressure": 0.38, "unknown": 0.02}, {}, GROUP),
        ({"unknown": 0.8, "gravity": 0.2}, {}, UNKNOWN),
        ({"unknown": 0.8, "gravity": 0.2}, {"unknown_sure": 1.0}, CANNOT_SAY),
        ({"registration": 0.95, "gravity": 0.05}, {}, NOT_PHYSICS),
        ({"registration": 0.5, "mesh": 0.45, "gravity": 0.05}, {}, NOT_PHYSICS),
        ({"registration": 0.8, "gravity": 0.2}, {}, CANNOT_SAY),
        ({"unknown": 0.8, "registration": 0.2}, {"p_value": 0.03}, CANNOT_SAY),
        ({"gravity": 0.97, "pressure": 0.03}, {"gain": -1.0}, CANNOT_SAY),
        # the alarm or the prediction may be weak, not both
        ({"gravity": 0.97, "pressure": 0.03}, {"sure": 2.0}, NAMED),
        ({"gravity": 0.97, "pressure": 0.03}, {"p_value": 0.03}, NAMED),
        ({"gravity": 0.97, "pressure": 0.03}, {"sure": 2.0, "p_value": 0.03}, CANNOT_SAY),
        ({"gravity": 0.97, "pressure": 0.03}, {"sure": -0.5}, CANNOT_SAY),
        ({"gravity": 0.97, "pressure": 0.03}, {"needed": 0.8}, CANNOT_SAY),
        ({"gravity": 0.97, "pressure": 0.03}, {"placebo_p": 0.3}, CANNOT_SAY),
        ({"gravity": 0.97, "pressure": 0.03}, {"size": 7.0}, CANNOT_SAY),
        # refits are surer than what is linear
        ({"gravity": 0.97, "pressure": 0.03}, {"p_value": 0.03, "chance": 0.001, "sure": 2.0}, NAMED),
        ({"gravity": 0.97, "pressure": 0.03}, {"aside": 0.2}, CANNOT_SAY),
        ({"gravity": 0.6, "pressure": 0.38, "unknown": 0.02}, {"aside": 0.2}, CANNOT_SAY),
        ({"unknown": 0.8, "gravity": 0.2}, {"aside": 0.2}, CANNOT_SAY),
        # what single pairs cannot have done
        ({"gravity": 0.97, "pressure": 0.03}, {"aside": 0.11, "set_aside": 7, "sure": 16.0}, CANNOT_SAY),
        ({"gravity": 0.97, "pressure": 0.03}, {"aside": 0.11, "set_aside": 7, "sure": 16.2}, NAMED),
        ({"gravity": 0.6, "pressure": 0.38, "unknown": 0.02}, {"aside": 0.11, "set_aside": 7, "sure": 16.2}, GROUP),
        ({"unknown": 0.8, "gravity": 0.2}, {"aside": 0.11, "set_aside": 7, "unknown_sure": 16.2}, UNKNOWN),
        ({"unknown": 0.8, "gravity": 0.2}, {"aside": 0.11, "set_aside": 7, "sure": 16.2}, CANNOT_SAY),
        ({"gravity": 0.6, "pressure": 0.38, "unknown": 0.02}, {"p_value": 0.03}, GROUP),
        ({"gravity": 0.6, "pressure": 0.38, "unknown": 0.02}, {"p_value": 0.03, "sure": 2.0}, CANNOT_SAY),
    ],
)
def test_it_says(chances: Mapping[str, float], known: Mapping[str, object], expected: str) -> None:
    assert decide(found(chances, **known)).verdict == expected


def test_a_name_that_is_kept_back_says_why() -> None:
    assert "held out" in decide(found({"gravity": 0.99}, sure=-0.1)).why


NAMES = [Verdict(NAMED_AND_REST, ("gravity",)), Verdict(NAMED, ("pressure",))]
NOTHING_MORE = Verdict(NOTHING, ())


@pytest.mark.parametrize(
    ("verdicts", "verdict", "kinds", "rest"),
    [
        ([NOTHING_MORE], NOTHING, (), None),
        ([NAMES[1], NOTHING_MORE], NAMED, ("pressure",), None),
        ([*NAMES, NOTHING_MORE], NAMED, ("gravity", "pressure"), None),
        ([NAMES[0], NOTHING_MORE], NAMED_AND_REST, ("gravity",), NOTHING_MORE),
        (
            [NAMES[0], Verdict(GROUP, ("falx", "contact"))],
            NAMED_AND_REST,
            ("gravity",),
            Verdict(GROUP, ("falx", "contact")),
        ),
        # what names leave is not significant: what might be in it is not said
        ([NAMES[1], Verdict(GROUP, ("falx", "contact"))], NAMED, ("pressure",), None),
        ([Verdict(UNKNOWN, ())], UNKNOWN, (), None),
    ],
)
def test_stages_come_to(verdicts: list[Verdict], verdict: str, kinds: tuple[str, ...], rest: Verdict | None) -> None:
    found = overall(verdicts)
    assert (found.verdict, found.kinds, found.rest) == (verdict, kinds, rest)
