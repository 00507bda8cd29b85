"""From a case, what a user has, to a model, what is assumed to act."""

import numpy as np

from warpbrain.cases.boundary import Displaced, Fixed, Forced
from warpbrain.cases.case import Case
from warpbrain.errors import InputError, require_kind
from warpbrain.physics.load import Load, NodalForce
from warpbrain.physics.mechanism import Mechanism
from warpbrain.simulation.model import Material, Model, Motion, with_mechanisms


def model_of(case: Case) -> Model:
    """The model of a case, as by `plain_model_of`, with all that the case assumes."""
    return with_mechanisms(plain_model_of(case), case.mechanisms)


def plain_model_of(case: Case) -> Model:
    """The model of a case without the mechanisms that it assumes, of the tissue that is left: a resection is done here.

    `Case.remaining` says which node of the whole mesh each of its nodes is. `InputError` if the case assumes what
    cannot be simulated; of a specimen, which `warpbrain.simulation.specimen` simulates test by test.
    """
    require_kind(case, Case, "case", "a Case, as warpbrain.find_case gives")
    if case.specimen is not None:
        raise InputError(f"{case.path}: [specimen]: a specimen has no one state; its tests are run by a Rig")
    mesh, nodes = case.remaining
    constrained = np.zeros(mesh.points.shape, dtype=bool)
    prescribed = np.zeros(mesh.points.shape)
    loads: list[Load] = []
    mechanisms: list[Mechanism] = []
    motions: list[Motion] = []
    for boundary in case.boundaries:
        members = case.mesh.node_sets[boundary.nodes][nodes]
        if isinstance(boundary, Fixed | Displaced):
            constrained[members] = True
        if isinstance(boundary, Displaced):
            prescribed[members] = boundary.final
            if boundary.has_history:
                motions.append(Motion(members, np.array(boundary.times), np.array(boundary.values)))
        elif isinstance(boundary, Forced):
            loads.append(
                NodalForce(nodes=boundary.nodes, total=boundary.total, mass=boundary.mass or 0.0, ramp=boundary.ramp)
            )
        elif boundary.mechanism is not None:
            mechanisms.append(boundary.mechanism)
    try:
        materials = {
            label: Material(tissue.known_law, case.poisson, tissue.formulation)
            for label, tissue in case.tissues.items()
        }
    except InputError as error:
        raise InputError(f"{case.path}: [tissue] {error}") from None
    return Model(mesh, materials, case.density, constrained, prescribed, loads, mechanisms, motions)
