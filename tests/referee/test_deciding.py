"""Verdicts of least expected loss by the tool's table."""

import itertools
import json

import pytest

from referee.calibrate import FILE
from referee.decision import Decision, decide, loss
from referee.diagnoses import NOT_PHYSICS, UNKNOWN
from warpbrain.inference import decide as tool


@pytest.mark.parametrize(
    ("sets", "verdict", "causes"),
    [
        ({(): 0.95, ("gravity",): 0.05}, "nothing missing", ()),
        ({("gravity",): 0.99, ("pressure",): 0.01}, "named", ("gravity",)),
        ({("gravity",): 0.5, ("pressure",): 0.48, (): 0.02}, "group", ("gravity", "pressure")),
        ({("gravity", "pressure"): 0.99, ("gravity",): 0.01}, "named", ("gravity", "pressure")),
        ({("gravity", UNKNOWN): 0.98, ("gravity",): 0.02}, "named + rest", ("gravity",)),
        ({(UNKNOWN,): 0.9, ("gravity",): 0.1}, "unknown", ()),
        ({(NOT_PHYSICS,): 0.95, (): 0.05}, "not physics", ()),
        ({(): 0.4, ("gravity",): 0.2, ("pressure",): 0.2, (NOT_PHYSICS,): 0.2}, "cannot say", ()),
    ],
)
def test_verdicts(sets, verdict, causes):
    losses = json.loads(FILE.read_text())["losses"]
    found = decide({frozenset(names): p for names, p in sets.items()}, losses)
    assert (found.verdict, found.causes) == (verdict, causes)


def test_the_analyst_pays_what_the_tool_pays():
    losses = json.loads(FILE.read_text())["losses"]
    names, wrong = ("gravity", "pressure", "swelling"), "registration"
    sets = [subset for size in range(3) for subset in itertools.combinations(names, size)]
    given = [(verdict, ()) for verdict in ("nothing missing", "cannot say", "unknown")]
    given += [(verdict, named) for verdict in ("named", "named + rest") for named in sets if named]
    given += [("group", names[:2]), ("group", ("gravity", UNKNOWN)), ("not physics", (wrong,))]
    for mechanisms, unknown, no_physics in itertools.product(sets, (False, True), (False, True)):
        true = frozenset((*mechanisms, *[UNKNOWN] * unknown, *[NOT_PHYSICS] * no_physics))
        same = tool.Truth(frozenset(mechanisms), unknown, frozenset([wrong] * no_physics))
        for verdict, causes in given:
            ours = loss(Decision(verdict, causes), true, losses)
            assert ours == tool.loss(tool.Decision(verdict, causes), same, losses), (verdict, causes, same)
