"""A small body under everything that a model can hold, and samples of it."""

from dataclasses import replace

import numpy as np
from bodies import model_of
from shapes import box, distorted

from warpbrain.ensemble.course import Course, step_samples
from warpbrain.ensemble.sample import Outcome, Sample
from warpbrain.physics.laws import Law, NeoHookean
from warpbrain.physics.mechanisms.gravity import Gravity
from warpbrain.simulation.model import Material, Model, Motion
from warpbrain.simulation.system import System

#: Shear moduli [Pa] that differ as those of the literature do.
MODULI = (600.0, 2500.0, 1000.0, 900.0, 5000.0, 700.0, 1500.0)


def shaken_block(law: Law, formulation: str = "coupled", moves: bool = True) -> Model:
    """Two tissues, held below, under a weight with a ramp; some nodes above pushed, some along a history."""
    mesh = distorted(box((2, 2, 3), (0.05, 0.05, 0.08)), 0.002, tissues=2)
    below = mesh.points[:, 2] < 0.004
    above = mesh.points[:, 2] > 0.076
    left = above & (mesh.points[:, 0] < 0.01)
    constrained = np.repeat(below[:, None], 3, axis=1)
    prescribed = np.zeros(mesh.points.shape)
    motions = []
    if moves:
        constrained[above] = True
        prescribed[above] = (0.0, 0.001, -0.002)
        values = np.array([[0.0, 0.0, 0.0], [0.001, 0.0, -0.001], [0.0, 0.001, -0.002]])
        motions = [Motion(left, np.array([0.0, 0.004, 0.009]), values)]
    weight = Gravity(direction=(1.0, 0.0, -1.0), density=1040.0, ramp=((0.0, 0.0), (0.005, 1.0)))
    first = Material(law, 0.45, formulation)
    second = Material(NeoHookean(1200.0), 0.4)
    return model_of(
        mesh, first, second, constrained=constrained, prescribed=prescribed, loads=[weight], motions=motions
    )


def samples_of(model: Model, moduli: tuple[float, ...] = MODULI) -> list[Sample]:
    """The model's materials at other moduli: `moduli` in the first tissue, half of that and 500 Pa in the second."""

    def scaled(material: Material, mu: float) -> Material:
        return replace(material, law=material.law.scaled_to(mu))

    return [
        Sample(number, {1: scaled(model.materials[1], mu), 2: scaled(model.materials[2], 500.0 + 0.5 * mu)})
        for number, mu in enumerate(moduli)
    ]


def computed(system: System, course: Course, samples: list[Sample], slots: int) -> dict[int, Outcome]:
    """Outcomes by number."""
    return {o.number: o for part in step_samples(system, course, samples, slots) for o in part}
