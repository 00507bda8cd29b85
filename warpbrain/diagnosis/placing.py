"""What acts in one place, between the places of a scan: a load on a patch, a ball that swells, a stiffer region.

A scan has a few sites in each direction, and two radii. From the best of them the place is moved as long as the linear
model gets better, at first by half a step of the scan, then by a quarter. There the centre and the radius become
coefficients beside the amount, which the fit changes without linearising. Their prior is as wide as that a step of the
scan is as probable as it is under a uniform one, and wider by what the scan leaves open: so the evidence of the fit is
the average over places near by, not the best, and amounts are no surer than the place is.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from warpbrain.diagnosis.refining import Refined, spread_of_place
from warpbrain.diagnosis.screened import Screened
from warpbrain.diagnosis.stack_evidence import StackEvidence
from warpbrain.errors import SolveError
from warpbrain.mesh import TetMesh, face_vectors, tangents
from warpbrain.physics.mechanism import Mechanism
from warpbrain.physics.proposal import Proposal
from warpbrain.worlds.body.effects import Effect

Floats = NDArray[np.float64]

#: Parts of a step of the scan by which a place is moved, one after the other; and how often each at most.
_STEPS, _MOVES = (0.5, 0.25), 6
#: Standard deviation in steps where a normal density is at its middle what a uniform one in the step is.
_CELL = 1.0 / np.sqrt(2.0 * np.pi)
#: Standard deviation of the logarithm of a radius of which nobody knows how sharply it ends: a ball with an edge has as
#: much in it as one that falls off smoothly to twice a radius which is 16 % smaller.
_PROFILE = 0.15
#: How far [standard deviations] the amount may be from zero where the place is sought: it is linear in it there.
_FARTHEST = 3.0


def placed(screened: Screened, number: int) -> Refined:
    """What the best effect of a scan comes to between its places.

    Parameters
    ----------
    screened : Screened
    number : int
        Of the effect, which acts in one place.
    """
    scan = _Scan(screened, number)
    best, value = _at(screened, screened.candidates.effects[number].proposed)
    for part in _STEPS:
        for _ in range(_MOVES):
            beside = [_at(screened, proposal) for proposal in scan.beside(best.proposed, part)]
            effect, other = max(beside, key=lambda one: one[1], default=(best, value))
            if other <= value:
                break
            best, value = effect, other
    wider = _wider(screened, best, scan)
    proposal = wider.proposed
    assert proposal.radius is not None
    sd = proposal.sd[-proposal.placing :]
    open_ = _unresolved(screened.mesh, proposal.radius, proposal.placing - 1)
    return Refined(wider, wider.columns[:, -proposal.placing :] * (open_ / sd))


def _unresolved(mesh: TetMesh, radius: float, directions: int) -> Floats:
    """Standard deviation (d + 1,) of the place that no fit resolves: uniform in an edge, and how sharply it ends."""
    edge = (6.0 * np.sqrt(2.0) * mesh.volume / len(mesh.tetrahedra)) ** (1.0 / 3.0) / np.sqrt(12.0)
    return np.array([*np.full(directions, edge), np.hypot(edge / radius, _PROFILE)])


def _at(screened: Screened, proposal: Proposal) -> tuple[Effect, float]:
    """The effect of a proposal at the state that was screened, and its log evidence there."""
    try:
        effect = _made(screened, proposal)
    except SolveError:
        return Effect(proposal, np.zeros(0), np.zeros((0, 0))), -np.inf
    white = screened.explanation.whitened(screened.residual)[:, None]
    return effect, float(
        StackEvidence(screened.explanation, screened.explanation.stack([effect])).log_places(white)[0, 0]
    )


class _Scan:
    """The places of a scan, and steps from one to the next.

    Parameters
    ----------
    screened : Screened
    number : int
        Of the best effect.
    """

    def __init__(self, screened: Screened, number: int) -> None:
        self._screened, self._mesh = screened, screened.mesh
        effects = screened.candidates.effects
        own = next(own for own in screened.candidates.of_kind.values() if number in own).tolist()
        self._numbers = [k for k in own if effects[k].proposed.elsewhere is not None]
        self._centres = np.array([effects[k].proposed.centre for k in self._numbers])
        self._radii = np.array([effects[k].proposed.radius for k in self._numbers])
        levels = np.unique(self._radii)
        self._step_of_radius = float(np.mean(np.diff(np.log(levels)))) if len(levels) > 1 else np.log(2.0)
        self._limits = levels[0] * np.exp(-self._step_of_radius), levels[-1] * np.exp(self._step_of_radius)
        self._step = _typical_distance(np.unique(self._centres, axis=0))

    def directions(self, proposal: Proposal) -> Floats:
        """Unit vectors (d, 3) along which its centre moves: along the surface, or any."""
        assert proposal.centre is not None
        return _tangents(self._mesh, proposal.centre) if proposal.on_surface else np.eye(3)

    def steps(self, directions: Floats) -> Floats:
        """From one place to the next (d + 1,): of the centre [m], and of the logarithm of the radius."""
        return np.array([*np.full(len(directions), self._step), self._step_of_radius])

    def beside(self, proposal: Proposal, part: float) -> list[Proposal]:
        """The same, moved by a part of a step in each direction, and with other radii."""
        assert proposal.elsewhere is not None and proposal.centre is not None and proposal.radius is not None
        directions = self.directions(proposal)
        found = []
        for move in np.vstack([part * np.diag(self.steps(directions)), -part * np.diag(self.steps(directions))]):
            radius = proposal.radius * float(np.exp(move[-1]))
            centre = proposal.centre + move[:-1] @ directions
            if proposal.on_surface:
                centre = _on_surface(self._mesh, centre)
            if self._limits[0] <= radius <= self._limits[1]:
                found.append(proposal.elsewhere(centre, radius))
        return found

    def spread(self, best: Proposal, directions: Floats) -> Floats:
        """Standard deviation (d + 1,) of the place beforehand: a step of the scan, and what the scan leaves open."""
        assert best.centre is not None and best.radius is not None
        at = np.column_stack([(self._centres - best.centre) @ directions.T, np.log(self._radii / best.radius)])
        return spread_of_place(at, self._screened.screen.places[self._numbers, 0], _CELL * self.steps(directions))


def _typical_distance(points: Floats) -> float:
    """Of a point to the nearest other one."""
    from scipy.spatial import cKDTree

    return float(np.median(cKDTree(points).query(points, k=2)[0][:, 1]))


def _nearest_face(mesh: TetMesh, point: Floats) -> tuple[Floats, Floats]:
    """Middle of the nearest face of the surface, and its unit normal."""
    from scipy.spatial.distance import cdist

    middles = _middles(mesh)
    nearest = int(np.argmin(cdist(point[None], middles)))
    [normal] = face_vectors(mesh.points, mesh.boundary[[nearest]])
    return middles[nearest], normal / np.linalg.norm(normal)


@lru_cache(maxsize=4)
def _middles(mesh: TetMesh) -> Floats:
    """Of the faces of the surface (b, 3) [m]: a search for a place asks for them at each of its steps."""
    return np.asarray(mesh.points[mesh.boundary].mean(axis=1))


def _on_surface(mesh: TetMesh, point: Floats) -> Floats:
    """A point near the surface, moved onto the plane of the nearest face."""
    middle, normal = _nearest_face(mesh, point)
    return np.asarray(point - normal @ (point - middle) * normal)


def _tangents(mesh: TetMesh, point: Floats) -> Floats:
    """Two directions (2, 3) along the surface."""
    return tangents(_nearest_face(mesh, point)[1])


def _wider(screened: Screened, best: Effect, scan: _Scan) -> Effect:
    """The same with its place among its coefficients."""
    proposal = best.proposed
    assert proposal.elsewhere is not None and proposal.centre is not None and proposal.radius is not None
    centre, radius, elsewhere, count = proposal.centre, proposal.radius, proposal.elsewhere, len(proposal)
    directions = scan.directions(proposal)
    sd = scan.spread(proposal, directions)

    def place(c: Floats) -> tuple[Floats, float]:
        return centre + c[count:-1] @ directions, radius * float(np.exp(c[-1]))

    def make(c: Floats) -> Mechanism:
        return elsewhere(*place(c)).make(c[:count])

    white = screened.explanation.whitened(screened.residual)[:, None]
    z, _ = StackEvidence(screened.explanation, screened.explanation.stack([best])).coefficients(
        white[:, 0], screened.kappa, 0
    )
    here = proposal.mean + proposal.sd * np.clip(z, -_FARTHEST, _FARTHEST)
    nowhere = np.zeros(len(sd))
    wider = replace(
        proposal,
        make=make,
        mean=np.concatenate([proposal.mean, nowhere]),
        sd=np.concatenate([proposal.sd, sd]),
        follows="smooth",
        start=np.concatenate([here, nowhere]),
        nothing=np.concatenate([proposal.without, nowhere]),
        place=place,
        elsewhere=None,
        placing=len(sd),
        log_covered=float(np.log(sd / (_CELL * scan.steps(directions))).sum()),
    )
    return _made(screened, wider)


def _made(screened: Screened, proposal: Proposal) -> Effect:
    assert screened.candidates.makes is not None
    [effect] = screened.candidates.makes.of([proposal])
    return effect
