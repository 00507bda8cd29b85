"""What is assumed to act on sets of nodes: one class a kind, plain data in SI units and RAS axes."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.keys import Key
from warpbrain.physics.mechanism import ClosedSurface, Mechanism
from warpbrain.physics.mechanisms.contact import Contact as SurfaceContact
from warpbrain.physics.mechanisms.pressure import Pressure

Ramp = Sequence[tuple[float, float]]
RAMP = Key("ramp", "pairs", "Factor over time [s]; 1 throughout if absent.")


@dataclass(frozen=True, kw_only=True)
class Boundary:
    """What all kinds have: a name, and a node set of the case's mesh."""

    kind: ClassVar[str]
    #: What `case.toml` says of this kind besides name and nodes.
    keys: ClassVar[tuple[Key, ...]] = ()
    #: Whether it acts on faces of the surface, and whether it keeps a part of the body from drifting away.
    on_faces: ClassVar[bool] = False
    holds: ClassVar[bool] = True
    name: str
    nodes: str

    @property
    def mechanism(self) -> Mechanism | None:
        """The mechanism that computes it, as if ``[[mechanism]]`` said it; None if conditions on nodes do."""
        return None

    def sentence(self) -> str:
        """What is assumed, for people to read."""
        raise NotImplementedError


@dataclass(frozen=True, kw_only=True)
class Fixed(Boundary):
    """Nodes that do not move."""

    kind: ClassVar[str] = "fixed"

    def sentence(self) -> str:
        return f"The {self.name} does not move."


@dataclass(frozen=True, kw_only=True)
class Sliding(Boundary):
    """Nodes that move along their surface only."""

    kind: ClassVar[str] = "sliding"
    on_faces: ClassVar[bool] = True

    @property
    def mechanism(self) -> Mechanism:
        return SurfaceContact(nodes=self.nodes)

    def sentence(self) -> str:
        return f"The {self.name} slides along its surface and does not leave it."


@dataclass(frozen=True, kw_only=True)
class Displaced(Boundary):
    """Nodes that are moved."""

    kind: ClassVar[str] = "displacement"
    keys: ClassVar[tuple[Key, ...]] = (
        Key(
            "value",
            "vector|file",
            "Displacement, or a .csv of it over time with the columns t, ux, uy, uz.",
            "units",
            needed=True,
            hint="value = [x, y, z]",
        ),
        RAMP,
    )
    times: tuple[float, ...]  # [s], increasing; one, if the displacement has no history
    values: tuple[tuple[float, float, float], ...]  # [m]; linear between the times, constant outside them
    file: str = ""  # where the history came from, relative to the case folder; empty if case.toml gives it

    @property
    def final(self) -> Floats:
        """Displacement (3,) [m] long after everything."""
        return np.array(self.values[-1])

    @property
    def has_history(self) -> bool:
        """Whether it says when it moves."""
        return len(self.times) > 1

    def sentence(self) -> str:
        size = 1000.0 * max(float(np.linalg.norm(value)) for value in self.values)
        return f"The {self.name} is moved by {size:.3g} mm{' at most, over time' if self.has_history else ''}."


@dataclass(frozen=True, kw_only=True)
class Forced(Boundary):
    """Nodes that share a total force [N] evenly, times a factor over time [s], and what hangs there [kg]."""

    kind: ClassVar[str] = "force"
    keys: ClassVar[tuple[Key, ...]] = (
        Key("total", "vector", "Total force, shared evenly by the nodes.", "N", needed=True),
        Key("mass", "number", "Of what hangs there and moves with the nodes; `total` has its weight.", "kg", above=0.0),
        RAMP,
    )
    holds: ClassVar[bool] = False
    total: tuple[float, float, float]
    mass: float | None = None  # moves with the nodes
    ramp: Ramp = field(default=())

    def sentence(self) -> str:
        size = float(np.linalg.norm(self.total))
        carried = "" if self.mass is None else f", which carry {self.mass:.3g} kg along"
        return f"A force of {size:.3g} N in all, shared evenly by the nodes of the {self.name}{carried}."


@dataclass(frozen=True, kw_only=True)
class Pressed(Boundary):
    """Faces of the nodes under a pressure [Pa] that follows them, times a factor over time [s]; positive pushes."""

    kind: ClassVar[str] = "pressure"
    keys: ClassVar[tuple[Key, ...]] = (
        Key("value", "number", "Pressure on the faces of the nodes, positive pushes.", "Pa", needed=True),
        RAMP,
    )
    on_faces: ClassVar[bool] = True
    holds: ClassVar[bool] = False
    value: float
    ramp: Ramp = field(default=())

    @property
    def mechanism(self) -> Mechanism:
        return Pressure(nodes=self.nodes, value=self.value, ramp=self.ramp)

    def sentence(self) -> str:
        return f"A pressure of {self.value:g} Pa on the {self.name}."


@dataclass(frozen=True, kw_only=True)
class Contact(Boundary):
    """Nodes that cannot cross a closed surface."""

    kind: ClassVar[str] = "contact"
    keys: ClassVar[tuple[Key, ...]] = (
        Key("surface", "file", "Closed surface that the nodes cannot cross.", needed=True),
        Key("friction", "number", "Coefficient of friction", above=-1e-300, default=0),
    )
    surface: ClosedSurface
    friction: float = 0.0

    @property
    def mechanism(self) -> Mechanism:
        return SurfaceContact(nodes=self.nodes, state="lifting", friction=self.friction, surface=self.surface)

    def sentence(self) -> str:
        return f"The {self.name} cannot cross the surface of {self.surface}; friction {self.friction:g}."


#: By the names that `case.toml` gives them.
BOUNDARIES: dict[str, type[Boundary]] = {
    kind.kind: kind for kind in (Fixed, Sliding, Displaced, Forced, Pressed, Contact)
}
