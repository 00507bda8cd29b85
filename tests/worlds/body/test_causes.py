"""Causes of which nothing that was recorded would tell."""

from types import SimpleNamespace

import numpy as np
import pytest

from warpbrain.inference import Cause, GaussianModel, Kind, Place
from warpbrain.inference.beliefs import belief
from warpbrain.worlds.body.causes import BodyCauses, _shares, visible

SIZES = np.array([0.1, 1.0, 2.0])
#: A nuisance that may shift everything by 1000 standard deviations of the noise.
MODEL = GaussianModel(np.eye(12), 1e3 * np.ones((12, 1)))


def cause(name: str, columns: np.ndarray, mean: np.ndarray | None = None, kind: Kind = Kind.PHYSICS) -> Cause:
    return Cause(name, (Place(np.zeros((12, 1))), Place(columns, mean)), np.log(0.05), SIZES, kind)


def test_what_nuisances_can_be_changes_nothing() -> None:
    shift, bend = np.full((12, 1), 50.0), np.linspace(-1.0, 1.0, 12)[:, None]
    given = (
        cause("shift", shift),
        cause("bend", bend),
        cause("weight", 1e-6 * bend, bend[:, 0]),
        cause("none", 0.0 * bend),
    )
    kept = visible(BodyCauses(given, {}), MODEL)
    assert [one.name for one in kept.causes] == ["bend", "weight"]


@pytest.mark.parametrize("kind", list(Kind))
@pytest.mark.parametrize("factor", [0.9, 1.1])
def test_the_largest_size_counts(kind: Kind, factor: float) -> None:
    pattern = np.linspace(-1.0, 1.0, 12)
    length = belief("checks.invisible") / (SIZES.max() * np.linalg.norm(pattern))
    kept = visible(BodyCauses((cause("bend", factor * length * pattern[:, None], kind=kind),), {}), MODEL)
    assert len(kept.causes) == (factor > 1.0)


def places(local: int, everywhere: int, declared: int) -> list:
    """Effects of a mechanism, so many in one place, throughout, and on node sets that a case declares."""
    proposals = (
        *[SimpleNamespace(centre=np.zeros(3), declared=False)] * local,
        *[SimpleNamespace(centre=None, declared=False)] * everywhere,
        *[SimpleNamespace(centre=None, declared=True)] * declared,
    )
    return [SimpleNamespace(proposed=proposal) for proposal in proposals]


@pytest.mark.parametrize("local", [0, 1, 7])
@pytest.mark.parametrize("everywhere", [0, 1, 2])
@pytest.mark.parametrize("declared", [0, 1, 4])
def test_places_share_what_is_believed_of_their_kind(local: int, everywhere: int, declared: int) -> None:
    counts = np.array([local, everywhere, declared])
    if not counts.any():
        return
    shares = _shares(places(*counts.tolist()))
    if np.count_nonzero(counts) == 1:
        assert shares is None
        return
    of_kind = np.array([part.sum() for part in np.split(shares, np.cumsum(counts)[:-1])])
    np.testing.assert_allclose(of_kind.sum(), 1.0)
    if declared:
        np.testing.assert_allclose(of_kind[2], belief("causes.on_declared"))
    if local and everywhere:
        np.testing.assert_allclose(of_kind[0] / of_kind[:2].sum(), belief("causes.in_one_place"))
