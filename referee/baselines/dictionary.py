"""The regression problem of a case: what was recorded, what is not known anyway, and a column for each candidate."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from concealed.observing import spread
from referee.baselines.elastic import Elastic
from referee.effects.effect import hill, plateau
from referee.effects.forces import BUOYANCY
from referee.law import Ogden, respond
from warpbrain.cases.case import Case
from warpbrain.mesh import boundary_faces, face_vectors, node_areas
from warpbrain.recordings.location import locate
from warpbrain.recordings.recording import PointsRecording

Floats = NDArray[np.float64]

#: Noise that is taken where none is declared [m].
SIGMA = 0.35e-3
#: Sites of local candidates, their radius [m], and levels of fluid in parts of the height.
SITES, RADIUS = 16, 0.016
LEVELS = (0.95, 0.85, 0.7, 0.5)


@dataclass(frozen=True, eq=False)
class Regression:
    """A linear model of a case.

    Attributes
    ----------
    y : (k,) array
        What was recorded less what the case declares, over the noise.
    nuisances : (k, p) array
        Rigid motion and the stiffness of each tissue.
    candidates : list of (name, (k, q) array)
        Columns of each candidate at each site.
    """

    y: Floats
    nuisances: Floats
    candidates: list[tuple[str, Floats]]


def regression_of(case: Case) -> Regression:
    """The regression problem of the recording that is to be fitted."""
    recording = next(r for r in case.recordings if isinstance(r, PointsRecording) and r.role == "fit")
    model = Elastic(case)
    place = locate(case.mesh.points, case.mesh.tetrahedra, recording.points)
    sigma = recording.sigma or SIGMA

    def seen(u: Floats) -> Floats:
        return place.interpolate(u.reshape(-1, 3)).ravel() / sigma

    y = recording.displacement.ravel() / sigma - seen(model.declared)
    tissues = [-model.fast(model.inner(case.mesh.tissue == label)) for label in np.unique(case.mesh.tissue)]
    rigid = [np.tile(axis, len(recording.points)) / sigma for axis in np.eye(3)]
    arm = recording.points - recording.points.mean(axis=0)
    rigid += [np.cross(axis, arm).ravel() / sigma for axis in np.eye(3)]
    nuisances = np.stack([*rigid, *map(seen, tissues)], axis=1)
    candidates = [(name, np.stack([seen(u) for u in columns], axis=1)) for name, columns in _displacements(model, case)]
    if recording.time is not None and len(np.unique(recording.time)) > 1:
        base = seen(model.declared)
        for tau in np.unique(recording.time) * 2.0:
            candidates.append(("viscoelasticity", (base * np.repeat(np.exp(-recording.time / tau), 3))[:, None]))
    return Regression(y, nuisances, candidates)


def _displacements(model: Elastic, case: Case) -> list[tuple[str, list[Floats]]]:
    mesh = case.mesh
    forces: list[tuple[str, list[Floats]]] = []
    down = np.array(case.gravity_axis or (0.0, -1.0, 0.0))
    height = -(model.centroids @ down)
    low, high = -(mesh.points @ down).max(), -(mesh.points @ down).min()
    for level in LEVELS:
        weight = BUOYANCY * model.volumes * (height > low + level * (high - low)) / 4.0
        nodal = np.bincount(mesh.tetrahedra.ravel(), np.repeat(weight, 4), minlength=len(mesh.points))
        forces.append(("gravity", [(nodal[:, None] * down).ravel()]))
    faces = boundary_faces(mesh.tetrahedra)
    inner = faces[mesh.node_sets["ventricle"][faces].all(axis=1)]
    force = np.zeros_like(mesh.points)
    np.add.at(force, inner.ravel(), np.repeat(-100.0 / 3.0 * face_vectors(mesh.points, inner), 3, axis=0))
    forces.append(("pressure", [force.ravel()]))
    surface = np.flatnonzero(mesh.node_sets["surface"] & ~mesh.node_sets["fixed"] & ~mesh.node_sets["ventricle"])
    areas = node_areas(mesh.points, faces)
    for node in surface[spread(mesh.points[surface], SITES)]:
        share = areas * hill(mesh.points, tuple(mesh.points[node]), RADIUS)
        forces.append(("traction", [(1000.0 * share[:, None] * axis).ravel() for axis in np.eye(3)]))
    # volumetric growth: a pressure of the bulk modulus for each part of the volume
    bulk = (model.lam + 2.0 / 3.0 * model.mu)[:, None, None] * np.eye(3)
    forces.append(("swelling", [model.stress(-0.01 * bulk)]))
    for element in spread(model.centroids, SITES):
        within = plateau(model.centroids, tuple(model.centroids[element]), RADIUS)
        forces.append(("swelling", [model.stress(-0.03 * within[:, None, None] * bulk)]))
        forces.append(("inclusion", [-model.inner(within)]))
    forces.append(("asymmetry", [_asymmetry(model)]))
    # all together: one pass over the factors serves many right sides
    moves = iter(model.fast(np.stack([f for _, columns in forces for f in columns], axis=1)).T)
    found = [(name, [next(moves) for _ in columns]) for name, columns in forces]
    released = model.released(mesh.node_sets["side"])
    return [*found, ("contact", [released - model.declared])]


def _asymmetry(model: Elastic) -> Floats:
    """Forces that Ogden's law of the exponent -15 adds to those of the neo-Hookean one in the declared state."""
    u = model.declared.reshape(-1, 3)[model.mesh.tetrahedra]
    F = np.eye(3) + np.swapaxes(u, 1, 2) @ model.gradients
    # elements that a linear model turns inside out are left alone
    F = np.where((np.linalg.det(F) > 0.2)[:, None, None], F, np.eye(3))[:, None]
    mu, none = model.mu[:, None], np.zeros((len(F), 1))
    laws = (Ogden((1.0,), (-15.0,)), Ogden((1.0,), (2.0,)))
    strong, plain = (respond(law, F, mu, mu, none).stress()[:, 0] for law in laws)
    return model.stress(strong - plain)
