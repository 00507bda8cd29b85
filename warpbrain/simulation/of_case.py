"""From a case, what a user has, to a model, what is assumed to act."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpbrain.cases.case import Case
from warpbrain.simulation.model import Material, Model


def model_of(case: Case) -> tuple[Model, NDArray[np.int32]]:
    """The model of a case.

    Returns
    -------
    model : Model
        Of the tissue that is left: a resection is done here.
    nodes : (n,) int array
        For each node of the model its id in the case's whole mesh.
    """
    mesh, nodes = case.mesh, np.arange(len(case.mesh.points), dtype=np.int32)
    if case.resection is not None:
        mesh, nodes = case.resection.remaining(mesh)
    constrained = np.zeros(mesh.points.shape, dtype=bool)
    prescribed = np.zeros(mesh.points.shape)
    for _, members, displacement in case.displaced:
        constrained[members[nodes]] = True
        prescribed[members[nodes]] = displacement
    for _, members in case.fixed:
        constrained[members[nodes]] = True
    materials = {
        label: Material(tissue.law, case.poisson, tissue.formulation) for label, tissue in case.tissues.items()
    }
    return Model(mesh, materials, case.density, constrained, prescribed, case.loads), nodes
