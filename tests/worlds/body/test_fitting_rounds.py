"""How often a fit goes on is decided by what it gains, not by the last digits of what it comes to."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from warpbrain.worlds.body import fit_search
from warpbrain.worlds.body.fit_search import FitSearch
from warpbrain.worlds.body.fitting import Fitter


@dataclass(frozen=True)
class Fit:
    """What of a fit tells how to go on."""

    reached: float
    unreached: float = 0.0
    converged: bool = True

    @property
    def log_evidence(self) -> float:
        return self.reached - self.unreached

    @property
    def marginal(self) -> Any:
        return SimpleNamespace(log_evidence=self.reached)


@pytest.mark.parametrize("sign", [-1.0, 0.0, 1.0])
def test_a_search_that_stays_where_it_is_ends(sign: float) -> None:
    """As at a stable limit, beyond which the linear model sees much to gain: two more rounds, however rounded."""
    rounds: list[float] = []
    search: Any = SimpleNamespace(
        minimise=lambda _: None, left_of_shapes=0.0, expected_gain=lambda: 90.0 - 1e-8 * sign * len(rounds)
    )

    def update(_: Any) -> Fit:
        rounds.append(500.0 + 1e-8 * sign * len(rounds))
        return Fit(rounds[-1])

    fitter: Any = SimpleNamespace(_update=update)
    found = Fitter._converged(fitter, search, -np.inf)
    assert len(rounds) == 3 and found.log_evidence == pytest.approx(410.0)


@pytest.mark.parametrize("rounding", [-1e-12, 1e-12])
def test_laws_that_stay_the_same_are_not_taken_in_part(monkeypatch: pytest.MonkeyPatch, rounding: float) -> None:
    """About the same point their columns are the same but for rounding, which does not undo the last change."""
    laws = np.arange(6.0)[:, None]
    search: Any = SimpleNamespace(
        _layout=SimpleNamespace(shapes=slice(0, 1)), _U=np.zeros((6, 1)), columns=np.zeros((6, 1)), _shapes=None,
        _shape_change=np.zeros((6, 1)), taken=1.0, residual=np.zeros(6), z=np.zeros(1), effects=(), mesh_errors=None,
        _base=SimpleNamespace(states=None, model=SimpleNamespace(whitened=lambda change: change)),
        _renew=lambda _: None, expected_gain=lambda: 0.0,
    )  # fmt: skip
    for made in (laws, laws * (1.0 + rounding), laws):
        search._about = (None, ())
        monkeypatch.setattr(fit_search, "shape_columns_about", lambda *_, made=made: made)
        FitSearch.update_shapes(search)
        assert search.taken == 1.0
    search._about = (None, ())
    monkeypatch.setattr(fit_search, "shape_columns_about", lambda *_: 0.5 * laws)
    FitSearch.update_shapes(search)
    assert search.taken == 0.5
