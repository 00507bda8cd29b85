"""Verdicts of least expected loss by the tool's table."""

import json

import pytest

from referee.calibrate import FILE
from referee.decision import decide
from referee.diagnoses import NOT_PHYSICS, UNKNOWN


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
