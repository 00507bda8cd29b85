"""Columns of each candidate cause at each of its places, and of unit forces at sites: what anybody may choose from.

A column is the response to a stated amount, so that columns of different causes are about alike in size.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from concealed.observing import spread
from referee.compliance.response import DeclaredResponse
from referee.effects.effect import hill, plateau, unit
from referee.effects.forces import BUOYANCY
from referee.faces import Floats
from referee.law import Ogden, respond
from warpbrain.mesh import boundary_faces, face_vectors, node_areas

#: Places of local causes: on the surface, in the tissue, on what is held; and sites of unit forces.
SURFACE, INSIDE, SUPPORT, SITES = 48, 64, 24, 48
#: Radii [m] of patches under traction, of balls that swell and that are harder, and of supports that give way.
TRACTION, SWOLLEN, HARDER, LOOSE = (0.0125,), (0.012, 0.018), (0.018, 0.026), (0.02, 0.04)
#: Depths [m] to which fluid drains, and parts of the last time in which tissue relaxes.
DEPTHS = (0.005, 0.01, 0.015, 0.02, 0.03, 0.045, 0.065, 0.09)
RELAXATION = (0.05, 0.1, 0.2, 0.4, 0.8)
#: Amounts: Pa, Pa, part of the volume in a ball and everywhere, logarithm of stiffness, exponent, m, part of all.
PRESSED, PULLED, SWELLS, SWELLS_ALL, HARDENS, EXPONENT, SLIDES, CREEPS = (
    100.0,
    1000.0,
    0.03,
    0.01,
    0.5,
    -15.0,
    1e-3,
    0.3,
)


@dataclass(frozen=True, eq=False)
class Candidate:
    """A cause at a place.

    Attributes
    ----------
    cause : str
    place : (3,) array
        [m]; NaN of one that acts everywhere.
    length : float
        Radius [m], depth of fluid [m] or relaxation time [s]; NaN if it has none.
    amount, unit : float and str
        To which each column responds.
    kind : {"force", "motion", "rows"}
        What `columns` are: forces (3 n, k) [N], motions (3 n, k) [m] of what is held, or rows themselves.
    columns : array
    """

    cause: str
    place: Floats
    length: float
    amount: float
    unit: str
    kind: str
    columns: Floats


_EVERYWHERE = np.full(3, np.nan)


def candidates(response: DeclaredResponse) -> Iterator[Candidate]:
    """Every candidate of a case, one at a time: their forces are large."""
    yield from _fluid(response)
    yield from _tractions(response)
    yield from _tissue(response)
    yield from _supports(response)
    yield from _creep(response)


def seen(response: DeclaredResponse, candidate: Candidate) -> Floats:
    """Rows (rows, k) of a candidate."""
    if candidate.kind == "rows":
        return candidate.columns
    return response.forces(candidate.columns) if candidate.kind == "force" else response.motions(candidate.columns)


def sites(response: DeclaredResponse) -> tuple[Floats, Floats]:
    """Places (s, 3) [m] spread over all that is free, and rows (rows, s, 3) of 1 N there, shared by near nodes."""
    body = response.body
    points = body.mesh.points
    free = np.flatnonzero(~body.held[0].reshape(-1, 3).any(axis=1))
    nodes = free[spread(points[free], min(SITES, len(free)))]
    volume = np.bincount(body.mesh.tetrahedra.ravel(), np.repeat(body.volumes / 4.0, 4), minlength=len(points))
    rows = []
    for node in nodes:
        share = volume * hill(points, tuple(points[node]), TRACTION[0])
        rows.append(response.forces(_along_axes(share / share.sum())))
    return points[nodes], np.stack(rows, axis=1)


def _along_axes(share: Floats) -> Floats:
    return np.stack([(share[:, None] * axis).ravel() for axis in np.eye(3)], axis=1)


def _fluid(response: DeclaredResponse) -> Iterator[Candidate]:
    body, mesh = response.body, response.body.mesh
    down = unit(np.array(body.case.gravity_axis or (0.0, -1.0, 0.0)))
    depth = body.centroids @ down - (mesh.points @ down).min()
    for level in DEPTHS:
        weight = np.repeat(BUOYANCY * body.volumes * (depth < level) / 4.0, 4)
        nodal = np.bincount(mesh.tetrahedra.ravel(), weight, minlength=len(mesh.points))
        force = (nodal[:, None] * down).reshape(-1, 1)
        yield Candidate("gravity", _EVERYWHERE, level, 1.0, "1", "force", force)
    faces = boundary_faces(mesh.tetrahedra)
    inner = faces[mesh.node_sets["ventricle"][faces].all(axis=1)]
    moved = mesh.points + body.declared.reshape(-1, 3)
    force = np.zeros_like(mesh.points)
    np.add.at(force, inner.ravel(), np.repeat(-PRESSED / 3.0 * face_vectors(moved, inner), 3, axis=0))
    yield Candidate("pressure", _EVERYWHERE, np.nan, PRESSED, "Pa", "force", force.reshape(-1, 1))


def _tractions(response: DeclaredResponse) -> Iterator[Candidate]:
    body, mesh = response.body, response.body.mesh
    held = body.held[0].reshape(-1, 3).any(axis=1)
    surface = np.flatnonzero(mesh.node_sets["surface"] & ~held & ~mesh.node_sets["ventricle"])
    areas = node_areas(mesh.points, boundary_faces(mesh.tetrahedra))
    for node in surface[spread(mesh.points[surface], min(SURFACE, len(surface)))]:
        for radius in TRACTION:
            share = PULLED * areas * hill(mesh.points, tuple(mesh.points[node]), radius)
            yield Candidate("traction", mesh.points[node], radius, PULLED, "Pa", "force", _along_axes(share))


def _tissue(response: DeclaredResponse) -> Iterator[Candidate]:
    body = response.body
    P = body.stress(response.F)
    # volumetric growth: a pressure of the bulk modulus for each part of the volume, in the deformed state
    inverse = np.swapaxes(np.linalg.inv(response.F), 1, 2)
    bulk = (body.lam + 2.0 / 3.0 * body.mu)[:, None, None] * inverse
    everywhere = body.nodal(SWELLS_ALL * bulk)[:, None]
    yield Candidate("swelling", _EVERYWHERE, np.nan, SWELLS_ALL, "1", "force", everywhere)
    for element in spread(body.centroids, min(INSIDE, len(body.centroids))):
        place = body.centroids[element]
        for radius in SWOLLEN:
            within = plateau(body.centroids, tuple(place), radius)[:, None, None]
            force = body.nodal(SWELLS * within * bulk)[:, None]
            yield Candidate("swelling", place, radius, SWELLS, "1", "force", force)
        for radius in HARDER:
            within = plateau(body.centroids, tuple(place), radius)[:, None, None]
            yield Candidate(
                "inclusion", place, radius, HARDENS, "1", "force", -body.nodal(HARDENS * within * P)[:, None]
            )
    F, none = response.F[:, None], np.zeros((len(body.mu), 1))
    mu, lam = body.mu[:, None], body.lam[:, None]
    other = respond(Ogden((1.0,), (EXPONENT,)), F, mu, lam + 2.0 / 3.0 * mu, none).stress()[:, 0]
    yield Candidate("asymmetry", _EVERYWHERE, np.nan, EXPONENT, "1", "force", -body.nodal(other - P)[:, None])


def _supports(response: DeclaredResponse) -> Iterator[Candidate]:
    """What is held gives way over a hill, as its support pushed it, along the wall or off it."""
    body, mesh = response.body, response.body.mesh
    held, value = body.held
    support: NDArray[np.bool_] = held.reshape(-1, 3).all(axis=1) & ~value.reshape(-1, 3).any(axis=1)
    nodes = np.flatnonzero(support & mesh.node_sets["surface"])
    faces = boundary_faces(mesh.tetrahedra)
    normals = np.zeros_like(mesh.points)
    np.add.at(normals, faces.ravel(), np.repeat(face_vectors(mesh.points, faces), 3, axis=0))
    pushed = response.inner.reshape(-1, 3)
    for node in nodes[spread(mesh.points[nodes], min(SUPPORT, len(nodes)))]:
        for radius in LOOSE:
            weight = support * hill(mesh.points, tuple(mesh.points[node]), radius)
            away = -(weight[:, None] * pushed).sum(axis=0)
            normal = unit((weight[:, None] * normals).sum(axis=0))
            along = away - (away @ normal) * normal
            for direction in (away, along):
                if np.linalg.norm(direction) > 0.0:
                    move = (SLIDES * weight[:, None] * unit(direction)).reshape(-1, 1)
                    yield Candidate("contact", mesh.points[node], radius, SLIDES, "m", "motion", move)


def _creep(response: DeclaredResponse) -> Iterator[Candidate]:
    """What has not crept yet is a part of the declared motion that goes with time."""
    time = response.rows_of.time
    if len(np.unique(time[np.isfinite(time)])) < 2:
        return
    for part in RELAXATION:
        tau = part * float(np.nanmax(time))
        left = np.where(np.isfinite(time), np.exp(-np.nan_to_num(time) / tau), 0.0)
        rows = (-CREEPS * left * response.predicted)[:, None]
        yield Candidate("viscoelasticity", _EVERYWHERE, tau, CREEPS, "1", "rows", rows)
