"""A patch that lets go, where it is and how large: from the best one of a scan to one between its places.

About the best patch the neighbours with other centres and radii are compared to first order, and the best of them is
gone on from. A patch on a mesh is a set of nodes: its answer jumps from one to the next. So the change of the answer
over centre and radius is that of a plane through all neighbours; with it the fit has the centre along the surface and
the radius as coefficients, beside the share. Their prior is the step of the scan, and what the scan leaves open: so the
evidence of the fit is the average over them, not the best.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from warpbrain.diagnosis.stack_evidence import StackEvidence
from warpbrain.diagnosis.stage import Stage
from warpbrain.errors import SolveError
from warpbrain.mesh import TetMesh, face_vectors, tangents
from warpbrain.physics.proposal import Patch, Proposal
from warpbrain.worlds.body.dictionary import BETWEEN, RADII, patch_of
from warpbrain.worlds.body.effects import Effect

Floats = NDArray[np.float64]

#: Step of the scan from one radius to the next, as a factor; how fine it is gone through, and moves at most.
_STEP = float(np.exp(np.mean(np.diff(np.log(RADII)))))
_PARTS, _MOVES = 3, 6
#: Standard deviation of a centre [m] and of the logarithm of a radius, uniform in a step of the scan; and how many
#: times that is the most that neighbours tell of.
_CELL, _WIDEST = np.array([BETWEEN, BETWEEN, np.log(_STEP)]) / np.sqrt(12.0), 3.0


@dataclass(frozen=True, eq=False)
class Refined:
    """What acts in one place, between the places of a scan.

    Attributes
    ----------
    effect : Effect
        With columns (n, k + d + 1): of its own coefficients, of its centre along d directions, of the logarithm of its
        radius. Along a surface d is 2, and what lets go has one coefficient, its share.
    unresolved : (n, d + 1) array
        What the mesh leaves open of centre and radius, one standard deviation each.
    """

    effect: Effect
    unresolved: Floats


def refined(stage: Stage, number: int) -> Refined:
    """The patch that an effect of a stage's scan comes to.

    Parameters
    ----------
    stage : Stage
    number : int
        Of the effect, which is a release.
    """
    best = stage.candidates.effects[number]
    mesh = stage.base.at.system.model.mesh
    residual = stage.explanation.whitened(stage.residual)[:, None]
    for _ in range(_MOVES):
        beside = _neighbours(stage, mesh, best.proposed)
        effects = [best, *beside]
        places = StackEvidence(stage.explanation, stage.explanation.stack(effects)).log_places(residual)[:, 0]
        chosen = int(np.argmax(places))
        if chosen == 0 or _same(effects[chosen], best):
            break
        best = effects[chosen]
    along = _tangents(mesh, best.proposed.released)
    coordinates = np.array([_coordinates(one.proposed, best.proposed, along) for one in effects])
    slopes = _slopes(coordinates, np.array([one.mean for one in effects]))
    sd = _spread(stage, number, best.proposed, along)
    return Refined(_effect(best, along, slopes, sd), slopes * _unresolved(mesh, best.proposed.released))


def _same(first: Effect, second: Effect) -> bool:
    return np.array_equal(first.proposed.released.members, second.proposed.released.members)


def _neighbours(stage: Stage, mesh: TetMesh, proposal: Proposal) -> list[Effect]:
    """Of patches with a centre within a step of the scan, and a radius."""
    patch, make = proposal.released, proposal.of_patch
    assert make is not None
    nodes = np.flatnonzero(patch.held & (np.linalg.norm(mesh.points - patch.centre, axis=1) <= BETWEEN))
    centres = [patch.centre, *mesh.points[nodes]]
    radii = [patch.radius * _STEP ** (k / _PARTS) for k in range(-_PARTS, _PARTS + 1)]
    found = []
    for centre in centres:
        for radius in radii:
            part = patch_of(mesh, patch.surface, patch.held, centre, radius)
            if part is None:
                continue
            try:
                found.extend(stage.base.effects.of([make(part)]))
            except SolveError:
                continue
    return found


def _tangents(mesh: TetMesh, patch: Patch) -> Floats:
    """Two directions (2, 3) along the surface of a patch."""
    faces = mesh.boundary[patch.members[mesh.boundary].all(axis=1)]
    outward = face_vectors(mesh.points, faces).sum(axis=0)
    return tangents(outward)


def _coordinates(proposal: Proposal, origin: Proposal, along: Floats) -> Floats:
    """Of a patch about another: along both tangents [m], and the logarithm of its radius."""
    one, other = proposal.released, origin.released
    return np.array([*(along @ (one.centre - other.centre)), np.log(one.radius / other.radius)])


def _slopes(coordinates: Floats, answers: Floats) -> Floats:
    """Change (n, 3) of the answer over the coordinates: a plane through all answers (v, n)."""
    design = np.column_stack([np.ones(len(coordinates)), coordinates / _CELL])
    return np.asarray(np.linalg.lstsq(design, answers, rcond=1e-6)[0][1:].T) / _CELL


def _spread(stage: Stage, number: int, best: Proposal, along: Floats) -> Floats:
    """Standard deviation (3,) of the coordinates beforehand: a step of the scan, and what the scan leaves open."""
    effects = stage.candidates.effects
    region = effects[number].proposed.released.held
    own = next(own for own in stage.candidates.of_kind.values() if number in own)
    patches = {k: patch for k in own.tolist() if (patch := effects[k].proposed.patch) is not None}
    alike = [k for k, patch in patches.items() if np.array_equal(patch.held, region)]
    at = np.array([_coordinates(effects[k].proposed, best, along) for k in alike])
    return spread_of_place(at, stage.screen.places[alike, 0], _CELL)


def spread_of_place(at: Floats, evidence: Floats, cell: Floats) -> Floats:
    """Standard deviation (d,) of a place beforehand: a step of a scan, and what the scan leaves open.

    Parameters
    ----------
    at : (v, d) array
        Coordinates of the places of the scan.
    evidence : (v,) array
        Theirs, logarithms.
    cell : (d,) array
        Standard deviation within a step.
    """
    from scipy.special import softmax

    weights = softmax(evidence)
    open_ = weights @ (at - weights @ at) ** 2
    return np.asarray(np.minimum(np.sqrt(cell**2 + open_), _WIDEST * cell))


def _unresolved(mesh: TetMesh, patch: Patch) -> Floats:
    """Standard deviation (3,) of the coordinates that nodes so far apart can tell: uniform in an edge."""
    faces = mesh.boundary[patch.held[mesh.boundary].all(axis=1)]
    edges = mesh.points[faces] - mesh.points[np.roll(faces, 1, axis=1)]
    edge = float(np.median(np.linalg.norm(edges, axis=2)))
    return np.array([edge, edge, edge / patch.radius]) / np.sqrt(12.0)


def _effect(best: Effect, along: Floats, slopes: Floats, sd: Floats) -> Effect:
    proposal, patch = best.proposed, best.proposed.released

    def place(c: Floats) -> tuple[Floats, float]:
        return patch.centre + c[1:3] @ along, patch.radius * float(np.exp(c[3]))

    wider = replace(
        proposal,
        mean=np.concatenate([proposal.mean, np.zeros(3)]),
        sd=np.concatenate([proposal.sd, sd]),
        start=np.zeros(4),
        place=place,
    )
    return Effect(wider, best.mean, np.column_stack([best.columns, slopes * sd]))
