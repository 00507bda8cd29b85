"""Where a held surface lets go, and how far: the mean over all patches that it may be, as they are probable.

The best patch is one of many: where the surface ends, a patch about another centre with another radius has nearly the
same nodes, and one that covers most of it has as good a centre anywhere. So its centre is the mean over centres on the
surface and radii, all alike likely beforehand, the radii by their logarithm; their evidence is to first order, divided
by the temperature of all evidence.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpbrain.diagnosis.calibration import BODIES
from warpbrain.diagnosis.stack_evidence import StackEvidence
from warpbrain.diagnosis.stage import Stage
from warpbrain.errors import SolveError
from warpbrain.mesh import TetMesh
from warpbrain.physics.proposal import Patch, Proposal
from warpbrain.worlds.body.dictionary import BETWEEN, RADII, patch_of
from warpbrain.worlds.body.effects import Effect
from warpbrain.worlds.body.values import Value

Floats = NDArray[np.float64]

#: Radii [m] that are tried, a factor of about a fifth apart: to half as much again as the largest of the scan, with
#: which a patch at the edge covers what the largest covers from within.
_RADII = np.geomspace(RADII[0], 1.5 * RADII[-1], 12)
#: Places of the scan less probable than this have no others tried about them.
_PROBABLE = 1e-3


@dataclass(frozen=True, eq=False)
class Placed:
    """Where something let go.

    Attributes
    ----------
    centre, centre_sd : (3,) array
        [m]
    radius, radius_sd : float
        [m]; mean and spread of the logarithm.
    """

    centre: Floats
    centre_sd: Floats
    radius: float
    radius_sd: float

    @property
    def values(self) -> tuple[Value, ...]:
        """As parameters."""
        each = zip("xyz", self.centre.tolist(), self.centre_sd.tolist(), strict=True)
        centre = tuple(Value(f"centre_{axis}", value, sd, "m") for axis, value, sd in each if sd > 0.0)
        return (*centre, Value("radius", 1e3 * self.radius, 1e3 * self.radius_sd, "mm"))


def where_it_lets_go(stage: Stage, kind: str) -> Placed:
    """Where a kind lets go at a stage that screens it.

    Parameters
    ----------
    stage : Stage
    kind : str
        Some of whose proposals are releases.
    """
    from scipy.special import softmax

    effects_of_all = stage.candidates.effects
    own = np.array([k for k in stage.candidates.of_kind[kind].tolist() if effects_of_all[k].proposed.patch is not None])
    chances = softmax(stage.screen.places[own, 0] / BODIES.temperature)
    probable = own[chances >= min(_PROBABLE, float(chances.max()))]
    proposals = [stage.candidates.effects[k].proposed for k in probable.tolist()]
    mesh = stage.base.at.system.model.mesh
    tried: list[_Tried] = []
    for alike in _by_what_they_do(proposals):
        tried.extend(_tried(stage, mesh, alike))
    if not tried:
        # of a surface that lets go as a whole, and is larger than any patch
        whole = [one.released for one in proposals]
        weights = softmax(stage.screen.places[probable, 0] / BODIES.temperature)
        return _mean(np.array([one.centre for one in whole]), np.array([one.radius for one in whole]), weights)
    effects = list({id(one.effect): one.effect for one in tried}.values())
    residual = stage.explanation.whitened(stage.residual)[:, None]
    places = StackEvidence(stage.explanation, stage.explanation.stack(effects)).log_places(residual)[:, 0]
    log = dict(zip(map(id, effects), places.tolist(), strict=True))
    weights = softmax([log[id(one.effect)] / BODIES.temperature for one in tried])
    return _mean(np.array([one.centre for one in tried]), np.array([one.radius for one in tried]), weights)


@dataclass(frozen=True, eq=False)
class _Tried:
    """A patch: its centre [m], radius [m], and what it does; one of the same nodes does the same."""

    centre: Floats
    radius: float
    effect: Effect


def _by_what_they_do(proposals: Sequence[Proposal]) -> list[list[Proposal]]:
    """Proposals that do the same on patches of the same surface."""
    found: dict[str, list[Proposal]] = {}
    any_of: dict[str, Patch] = {}
    for one in proposals:
        assert one.of_patch is not None
        same = one.of_patch(any_of.setdefault(one.released.surface, one.released))
        found.setdefault(repr(same.make(same.mean)), []).append(one)
    return list(found.values())


def _tried(stage: Stage, mesh: TetMesh, proposals: Sequence[Proposal]) -> list[_Tried]:
    """Patches of any radius about nodes and edges of a surface that are near to some that do the same."""
    patch, make = proposals[0].released, proposals[0].of_patch
    assert make is not None
    faces = mesh.boundary[patch.held[mesh.boundary].all(axis=1)]
    edges = np.unique(np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1), axis=0)
    centres = np.concatenate([mesh.points[np.unique(faces)], mesh.points[edges].mean(axis=1)])
    near = np.array([one.released.centre for one in proposals])
    distances = np.linalg.norm(centres[:, None] - near, axis=2).min(axis=1)
    known: dict[bytes, Effect | None] = {}
    found = []
    for centre in centres[distances <= BETWEEN]:
        for radius in _RADII.tolist():
            part = patch_of(mesh, patch.surface, patch.held, centre, radius)
            if part is None:
                continue
            key = part.members.tobytes()
            if key not in known:
                known[key] = _released(stage, make(part))
            effect = known[key]
            if effect is not None:
                found.append(_Tried(centre, radius, effect))
    return found


def _released(stage: Stage, proposal: Proposal) -> Effect | None:
    """What a release does; None where it would leave no equilibrium."""
    try:
        return stage.base.effects.of([proposal])[0]
    except SolveError:
        return None


def _mean(centres: Floats, radii: Floats, weights: Floats) -> Placed:
    centre = weights @ centres
    log = float(weights @ np.log(radii))
    radius = float(np.exp(log))
    return Placed(
        centre,
        np.sqrt(weights @ (centres - centre) ** 2),
        radius,
        radius * float(np.sqrt(weights @ (np.log(radii) - log) ** 2)),
    )
