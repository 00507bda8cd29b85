"""A system at parameters a little beside those it has, and derivatives along the way there.

    dg/dtheta_k = sum_d w_d g(theta + d h e_k) / h,    d = -2, -1, 1, 2

is a five-point difference, with an error of `h^4 g^(5) / 30`. With a step `h` of `epsilon^(1/5)` of what changes much
it is exact to some 1e-12 in double precision. So no law and no mechanism has to know its derivatives: none can be
wrong, and no adjoint kernels are compiled, which would take twice as long for every one. What is linear in a parameter
(loads, pressures, tensions) is exact but for rounding whatever the step.

What terms remember (of earlier steps, of augmentations) differs from parameter to parameter too. It is kept for each of
the four places beside each parameter, and goes on there along a way of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import ArrayLike

from warpbrain.arrays import Floats
from warpbrain.physics.term import Term
from warpbrain.simulation.model import Model
from warpbrain.simulation.system import System

#: What a vector of parameters means: a model that differs in numbers only; see `System.set_model`.
ModelOf = Callable[[Floats], Model]
#: What each term of a system remembers.
Remembered = list[tuple[wp.array, ...]]
#: From how far from a parameter a system is, and the model there, to what is differentiated.
Looked = Callable[[float, Model], Floats]

#: Weights of the values at -2, -1, 1 and 2 steps in the derivative.
_STENCIL = {-2: 1.0 / 12.0, -1: -8.0 / 12.0, 1: 8.0 / 12.0, 2: -1.0 / 12.0}


class ParameterStencil:
    """Places beside each of p parameters.

    `models`, from parameters (p,) to models, is smooth and defined a little around `theta` (p,), where the `model` is.
    `scales` (p,) say by how much each must change to change much; by default its size, or 1 if that is less or nothing.
    `steps` (p,) are the `h` of each.
    """

    def __init__(self, system: System, models: ModelOf, theta: ArrayLike, scales: ArrayLike | None = None) -> None:
        self.system = system
        point = np.asarray(theta, dtype=np.float64)
        if scales is None:
            # one over a small exponent of Ogden's law is a modulus: a step must not come near to its sign
            sizes = np.where(point == 0.0, 1.0, np.minimum(1.0, np.abs(point)))
        else:
            sizes = np.asarray(scales, dtype=np.float64)
        self.steps = system.precision.epsilon**0.2 * sizes
        self.model = models(point)
        self._made: dict[int, Term] = {}
        directions = np.diag(self.steps)
        self._places = [{distance: models(point + distance * h) for distance in _STENCIL} for h in directions]
        system.set_model(self.model)
        remembered = system.remembered()
        self._remembered = [dict.fromkeys(_STENCIL, remembered) for _ in self._places]
        self._here = remembered

    def __len__(self) -> int:
        return len(self._places)

    def derivative(self, k: int, look: Looked) -> Floats:
        """The derivative by parameter k of what `look` finds; call it inside `away`."""
        return self._weighted(k, lambda distance: look(*self._go(k, distance)))

    def _weighted(self, k: int, value: Callable[[int], Floats]) -> Floats:
        """Derivative by parameter k of what is known at each distance."""
        total: Floats | float = 0.0
        for distance, weight in _STENCIL.items():
            total = total + weight * value(distance)
        return np.asarray(total) / self.steps[k]

    @property
    def remembers(self) -> bool:
        """Whether anything is ever remembered."""
        return any(term.memory for term in self.system.terms)

    def remember(self, act: Callable[[int, float], None]) -> None:
        """Do what changes what is remembered at every place, given parameter and offset; call it inside `away`."""
        for k, remembered in enumerate(self._remembered):
            for distance in _STENCIL:
                offset, _ = self._go(k, distance)
                act(k, offset)
                remembered[distance] = self.system.remembered()

    def shift_memory(self, before: Remembered, after: Remembered) -> None:
        """Add the same to what is remembered at every place: `after - before`."""
        for remembered in self._remembered:
            for place in remembered.values():
                for arrays, old, new in zip(place, before, after, strict=True):
                    for array, a, b in zip(arrays, old, new, strict=True):
                        array.assign(array.numpy() + (b.numpy() - a.numpy()))

    def _go(self, k: int, distance: int) -> tuple[float, Model]:
        model = self._places[k][distance]
        self.system.set_model(model, self._made)
        if self.remembers:
            self.system.recall(self._remembered[k][distance])
        return distance * float(self.steps[k]), model

    @contextmanager
    def away(self) -> Iterator[None]:
        """Afterwards the system has the parameters, the displacement and the memory that it has now."""
        u, self._here = self.system.u.numpy().copy(), self.system.remembered()
        try:
            yield
        finally:
            with self.here():
                self.system.u.assign(u)

    @contextmanager
    def here(self) -> Iterator[None]:
        """The parameters and the memory that the system had before it went away; inside `away`."""
        self.system.set_model(self.model, self._made)
        self.system.recall(self._here)
        yield

    def by_loads(self, k: int, time: float) -> Floats:
        """Derivative of the external forces [N] at a time [s] by parameter k; nothing is asked of a system."""
        here = (list(self.model.loads), self.model.emptying)
        if all((list(model.loads), model.emptying) == here for model in self._places[k].values()):
            return np.zeros((self.system.size, 3))
        # the product rule: factors and what is left of the tissue, then the loads themselves, which may know better
        factors = self._of_models(k, lambda model: model.external_forces(time, self.model.unit_forces))
        nodes = self.model.quadratic or self.model.mesh

        def of_load(number: int, of: Callable[[Any], Floats]) -> Floats:
            return self._of_models(k, lambda model: of(model.loads[number]))

        rates = [load.unit_forces_rate(nodes, partial(of_load, n)) for n, load in enumerate(self.model.loads)]
        return factors + self.model.external_forces(time, rates)

    def by_prescribed(self, k: int) -> Floats:
        """Derivative of the prescribed displacements [m] by parameter k; nothing is asked of a system."""
        # differences from here, so that what does not change is zero and no rounding
        return self._of_models(k, lambda model: model.prescribed - self.model.prescribed)

    def _of_models(self, k: int, of: Callable[[Model], Floats]) -> Floats:
        """Derivative by parameter k of what a function finds for a model."""
        return self._weighted(k, lambda distance: of(self._places[k][distance]))
