"""What is not known of a case and is no missing physics: noise, registration, tissue, the law.

Spreads are those of `referee.setting`, which docs/referee.md publishes; the truth of a case is not looked at.
"""

from __future__ import annotations

import numpy as np

from referee.challenge.noise import Noise, covariance_of
from referee.compliance.observed import Observed
from referee.compliance.response import DeclaredResponse
from referee.faces import Floats
from referee.law import Law, respond
from referee.setting import BOTH_LAWS, EACH, NOISE, OVERALL, POISSON, SHARED, SHARED_LENGTH, SHIFT, TURN, mean_square
from referee.unknowns import stiffness_modes

#: Modes of the stiffness field, and standard deviation of how much of the recovered error of the mesh there is: linear
#: tetrahedra leave more than recovery shows (once to twice as much in three opened cases of run 15).
MODES, UNRESOLVED = 24, 2.0
#: Noise as it is drawn.
NOISES = Noise(mean_square(NOISE), SHARED, SHARED_LENGTH)


def noise_covariance(rows: Observed) -> Floats:
    """Covariance (rows, rows) of noise: each point's own, and what neighbours share at the same time."""
    return covariance_of(NOISES, rows.place, rows.direction, rows.kind, rows.time, rows.sigma)


def nuisances(response: DeclaredResponse) -> tuple[list[str], Floats]:
    """Names and columns (rows, k), each of an amount of mean 0 and variance 1."""
    body, rows = response.body, response.rows_of
    names, columns = zip(*_registration(response), strict=True)
    P = body.stress(response.F)
    local = body.volumes[:, None, None] * (body.gradients @ np.swapaxes(P, 1, 2))
    forces: list[tuple[str, Floats]] = [("stiffness of all tissue", -OVERALL * response.inner)]
    for label in np.unique(body.mesh.tissue).tolist():
        within = (body.mesh.tissue == label)[:, None, None]
        forces.append((f"stiffness of tissue {label}", -EACH * body.gathered(local * within)))
    modes = stiffness_modes(body.centroids, np.linalg.norm(local, axis=(1, 2)), MODES)
    forces += [("stiffness field", -body.gathered(local * mode[:, None, None])) for mode in modes.T]
    forces.append(("Poisson ratio", -body.nodal(_poisson(response))))
    forces += [("mesh", -UNRESOLVED * force) for force in _unresolved(response)]
    forces += [("law", -np.sqrt(share) * body.nodal(_law(response, law) - P)) for law, share in BOTH_LAWS]
    seen = response.forces(np.stack([force for _, force in forces], axis=1))
    all_names = [*names, *(name for name, _ in forces)]
    return all_names, np.concatenate([np.stack(columns, axis=1).reshape(len(rows.kind), -1), seen], axis=1)


def _registration(response: DeclaredResponse) -> list[tuple[str, Floats]]:
    rows, points = response.rows_of, response.body.mesh.points
    moves = rows.kind != "force"
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    columns = []
    for axis in np.eye(3):
        columns.append(("shift", SHIFT / np.sqrt(3.0) * moves * (rows.direction @ axis)))
    arm = rows.place - middle
    for axis in np.eye(3):
        turned = np.einsum("ki,ki->k", np.cross(axis, arm), rows.direction)
        columns.append(("turn", TURN / np.sqrt(3.0) * moves * turned))
    return columns


def _poisson(response: DeclaredResponse) -> Floats:
    """Change of stress between the declared ratio and what is drawn: the middle of it and its spread together."""
    body = response.body
    low, high = POISSON
    declared = body.case.poisson
    away = np.hypot(0.5 * (low + high) - declared, (high - low) / np.sqrt(12.0))
    # lam = 2 mu nu / (1 - 2 nu)
    slope = 2.0 * body.mu / (1.0 - 2.0 * declared) ** 2
    inverse = np.swapaxes(np.linalg.inv(response.F), 1, 2)
    return (away * slope * np.log(np.linalg.det(response.F)))[:, None, None] * inverse


def _unresolved(response: DeclaredResponse) -> list[Floats]:
    """Forces (3 n,) [N] of the stress that is recovered less that of the elements: its volumetric part, and the rest.

    The recovered stress is continuous within a tissue, the mean of the elements about each node by volume (Zienkiewicz
    and Zhu 1987).
    """
    body, tetrahedra = response.body, response.body.mesh.tetrahedra
    inverse = np.swapaxes(np.linalg.inv(response.F), 1, 2)
    volumetric = (body.lam * np.log(np.linalg.det(response.F)))[:, None, None] * inverse
    unresolved = []
    for P in (volumetric, body.stress(response.F) - volumetric):
        away = np.zeros_like(P)
        for label in np.unique(body.mesh.tissue):
            within = body.mesh.tissue == label
            corners = tetrahedra[within].ravel()
            volume, flat = np.repeat(body.volumes[within], 4), np.repeat(P[within].reshape(-1, 9), 4, axis=0)
            n = len(body.mesh.points)
            total = np.maximum(np.bincount(corners, volume, minlength=n), 1e-30)
            nodal = np.stack([np.bincount(corners, volume * part, minlength=n) for part in flat.T], axis=1)
            recovered = (nodal / total[:, None])[tetrahedra[within]].mean(axis=1)
            away[within] = recovered.reshape(-1, 3, 3) - P[within]
        unresolved.append(body.nodal(away))
    return unresolved


def _law(response: DeclaredResponse, law: Law) -> Floats:
    """Stress (m, 3, 3) of the referee's law with the declared moduli."""
    body = response.body
    bulk = body.lam + 2.0 / 3.0 * body.mu
    F, none = response.F[:, None], np.zeros((len(body.mu), 1))
    return respond(law, F, body.mu[:, None], bulk[:, None], none).stress()[:, 0]
