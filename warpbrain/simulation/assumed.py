"""A model in which mechanisms act, from one in which they do not."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from warpbrain.physics.load import Load
from warpbrain.physics.mechanism import Mechanism, Removing, Substituting
from warpbrain.simulation.model import Material, Model


def with_mechanisms(model: Model, mechanisms: Sequence[Mechanism]) -> Model:
    """The model with mechanisms that act too.

    Those that are loads go to the loads, those that say another law or compressibility change the materials, in their
    order, and all others act in the system. With other numbers of the same mechanisms (`with_numbers`) the model is one
    that `System.set_model` takes.

    Parameters
    ----------
    model : Model
        If tissue is removed, of what is left.
    mechanisms : sequence of Mechanism
    """
    loads = [m for m in mechanisms if isinstance(m, Load)]
    materials = all_substituted(model.materials, mechanisms)
    acting = [m for m in mechanisms if not isinstance(m, Removing | Load)]
    return replace(model, materials=materials, loads=(*loads, *model.loads), mechanisms=(*acting, *model.mechanisms))


def all_substituted(materials: Mapping[int, Material], mechanisms: Iterable[Mechanism]) -> dict[int, Material]:
    """The materials of tissues as those mechanisms that say something of their law have them, in their order."""
    found = dict(materials)
    for mechanism in mechanisms:
        if isinstance(mechanism, Substituting):
            found = substituted(found, mechanism)
    return found


def substituted(materials: Mapping[int, Material], mechanism: Substituting) -> dict[int, Material]:
    """The materials of tissues as a mechanism that says something of their law has them."""
    return {
        label: Material(*mechanism.substitute(label, m.law, m.poisson, m.formulation)) for label, m in materials.items()
    }
