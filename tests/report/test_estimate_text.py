"""What an estimate prints of tissue averaged over causes."""

import numpy as np
import pytest
from synthetic import WHITE, block

from warpbrain.estimation.parameters import Parameters
from warpbrain.inference.calibration import percent
from warpbrain.inference.causes import Kind
from warpbrain.report.estimate import averaged_row, describe_nothing_else
from warpbrain.report.page import lines
from warpbrain.worlds.body.uncertainty import AveragedTissue, LikelyCause


def averaged(nothing: float) -> AveragedTissue:
    means = np.log([[1000.0], [2000.0]])
    return AveragedTissue(
        Parameters.of(block({"brain": WHITE}, "pushed")),
        nothing,
        (LikelyCause("pressure", Kind.PHYSICS, 1.0 - nothing), LikelyCause("mesh", Kind.NOT_PHYSICS, 0.01)),
        np.array([nothing, 1.0 - nothing]),
        means,
        np.full((2, 1, 1), 0.01),
    )


def printed(known: AveragedTissue) -> list[str]:
    said = describe_nothing_else(known)
    return lines("estimate.txt", "nothing_else", said, [averaged_row(one) for one in said["tissue"]])


def test_what_is_more_probable_than_nothing_is_printed():
    first, causes, _, row = printed(averaged(0.0))
    assert first.endswith(f"case says: {percent(0.0)}")
    assert causes == f"  what may act: pressure {percent(1.0)}"
    assert row.split()[:3] == ["brain", "shear", "modulus"] and row.split()[-1] == "Pa"
    assert [float(word) for word in row.split()[3:5]] == pytest.approx([2000.0, 200.0])


def test_where_nothing_is_the_most_probable_only_that_is_printed():
    assert printed(averaged(0.6)) == ["  probability that nothing acts but what the case says: 60 %"]
