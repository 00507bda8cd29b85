"""What acts in a truth that its case does not declare: one class a kind, each with a size."""

from __future__ import annotations

from referee.effects.body_forces import Attraction, Stripes, Swirl, UniformForce
from referee.effects.contact import Contact
from referee.effects.effect import Effect
from referee.effects.forces import Gravity, Pressure, Traction
from referee.effects.outside import PreStress, Tether, Wire
from referee.effects.tissue import Asymmetry, Inclusion, Swelling, Viscoelasticity

__all__ = [
    "Asymmetry",
    "Attraction",
    "Contact",
    "Effect",
    "Gravity",
    "Inclusion",
    "PreStress",
    "Pressure",
    "Stripes",
    "Swelling",
    "Swirl",
    "Tether",
    "Traction",
    "UniformForce",
    "Viscoelasticity",
    "Wire",
]
