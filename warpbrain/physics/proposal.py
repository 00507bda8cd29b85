"""What a mechanism proposes where it is looked for: ways in which it may act that a case does not declare.

A proposal is a family of mechanisms, made from a few coefficients `c` that are normal beforehand. A diagnosis scans the
proposals of a kind (places, levels, node sets), and averages over them: that is the price of looking elsewhere.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from warpbrain.arrays import Bools, Floats, Int32s
from warpbrain.mesh import TetMesh
from warpbrain.mesh.free_surfaces import FreeSurface

if TYPE_CHECKING:
    from warpbrain.physics.mechanism import Mechanism

#: A point or a direction.
Place = tuple[float, float, float]

#: How the effect of a proposal follows its coefficients: in proportion, to first order about a start that does nothing,
#: all at once, all at once where something that held it lets go, as a course in time that coefficients hasten, or as
#: what came at once and fades.
Follows = Literal["proportional", "smooth", "switch", "release", "course", "fading"]


class NotTestableError(Exception):
    """A mechanism that the data of a case cannot show; the message says what is missing."""


@dataclass(frozen=True, eq=False)
class Patch:
    """Some of the nodes that a case holds."""

    name: str  # of the node set that they become
    surface: str  # of the one that they are a part of
    members: Bools  # (n,), which nodes they are
    held: Bools  # (n,), all nodes of that surface
    centre: Floats  # (3,) [m]
    radius: float  # [m]

    @classmethod
    def disc(cls, mesh: TetMesh, nodes: str, held: Bools, centre: Floats, radius: float) -> Patch | None:
        """Nodes of a held set `nodes` (n,) within a radius [m] of a point; None if they have no face."""
        members = held & (np.linalg.norm(mesh.points - centre, axis=1) <= radius)
        if not members[mesh.boundary].all(axis=1).any():
            return None
        x, y, z = 1000.0 * centre
        return cls(f"{nodes}-{1000.0 * radius:.0f}-near-{x:.0f}-{y:.0f}-{z:.0f}", nodes, members, held, centre, radius)


@dataclass(frozen=True, eq=False)
class Situation:
    """What a mechanism may know of a case in which it is looked for."""

    mesh: TetMesh  # the simulated one
    gravity_axis: tuple[float, float, float] | None
    density: float  # [kg/m3]
    poisson: float
    assumed: frozenset[str]  # kinds of mechanisms that the case assumes
    laws: frozenset[str]  # of its tissues
    held: tuple[Patch, ...]  # parts of the surface that nothing moves
    free: tuple[FreeSurface, ...]  # parts of the surface that nothing holds, each a node set of the mesh
    instants: int  # at how many times something was recorded
    volume_sites: Floats  # (k, 3), points a spacing apart in the tissue [m]
    surface_sites: Floats  # (k, 3), and on its free surface [m]
    spacing: float  # [m]
    #: How many times stiffer than brain the body is, 1 at least: by that stresses that may act on it are larger
    stiffness: float = 1.0
    #: How x, y and z run, for people
    axes: tuple[str, str, str] = ("from left to right", "from posterior to anterior", "from inferior to superior")
    #: Every part of the surface that can move, with what people call it: what something acts on already, too
    named: tuple[tuple[str, Int32s], ...] = ()
    #: Node sets of the surface without a face, edges and points, that the case declares and nothing in it names
    unused: tuple[str, ...] = ()

    @cached_property
    def _names(self) -> tuple[Any, list[str]]:
        """A tree of the middles of triangles, and the name of each: that of the smallest part that it belongs to."""
        from scipy.spatial import cKDTree

        names: dict[bytes, tuple[Int32s, str]] = {}
        for words, faces in sorted(self.named, key=lambda part: -len(part[1])):
            names.update({row.tobytes(): (row, words) for row in np.sort(faces, axis=1)})
        rows = np.array([row for row, _ in names.values()], dtype=np.int64).reshape(-1, 3)
        return cKDTree(self.mesh.points[rows].mean(axis=1)), [words for _, words in names.values()]

    def surface_at(self, point: Floats) -> str:
        """What people call the surface that is nearest to a point (3,) [m]; empty if nothing can move."""
        if not self.named:
            return ""
        tree, words = self._names
        return words[int(tree.query(point)[1])]

    def require_new(self, kind: str) -> None:
        """Raise `NotTestableError` if the case assumes a mechanism already."""
        if kind in self.assumed:
            raise NotTestableError("the case assumes it already")


@dataclass(frozen=True)
class Tests:
    """What a mechanism may know of the tests on a specimen that may be fitted."""

    # not a test of pytest's
    __test__ = False
    modes: frozenset[str]
    loads: int  # how many different ones: other modes, or other directions of the tissue
    #: Whether an axial test pulls, and whether one presses; what is pulled along two axes is pressed along the third
    tension: bool
    compression: bool


def modes_between(times: Floats, modes: Floats, at: float | Floats) -> Floats:
    """Modes (m, r) at times (m,) [s], increasing, linear between these: at times (...) [s], (..., r)."""
    return np.stack([np.interp(at, times, mode) for mode in modes.T], axis=-1)


@dataclass(frozen=True, eq=False)
class Varying:
    """Coefficients of a proposal that are smooth functions of time.

    A coefficient that varies is `mean + sum_j modes_j(t) c_j`, with modes of a Gaussian process.
    """

    base: Proposal  # what acts at one time
    times: Floats  # (m,) [s], increasing: at which states are looked at; the last stands for the end
    modes: Floats  # (m, r), at these times

    @property
    def fixed(self) -> tuple[int, ...]:
        """Numbers of the coefficients that do not vary; they come first."""
        return tuple(k for k in range(len(self.base)) if k not in self.base.varying)

    def modes_at(self, time: float | Floats) -> Floats:
        """Modes at times (...) [s], linear between the known ones: (..., r)."""
        return modes_between(self.times, self.modes, time)

    def at(self, c: Floats, time: float) -> Floats:
        """Coefficients (k,) of what acts at a time."""
        coefficients = self.base.mean.copy()
        coefficients[list(self.fixed)] = c[: len(self.fixed)]
        courses = c[len(self.fixed) :].reshape(len(self.base.varying), -1)
        coefficients[list(self.base.varying)] += courses @ self.modes_at(time)
        return coefficients

    def mechanisms(self, c: Floats) -> tuple[Mechanism, ...]:
        """What acts over time, each with a ramp."""
        by_time = np.array([self.at(c, time) for time in self.times.tolist()])
        if self.base.in_turns:
            acting = [self.base.make(coefficients) for coefficients in by_time]
            # one after the other, each growing as the one before it goes
            turns = zip(acting, np.eye(len(self.times)), strict=True)
            return tuple(self._ramped(mechanism, hat * mechanism.factor()) for mechanism, hat in turns)
        ramped = []
        for number, sizes in enumerate(by_time.T):
            largest = float(sizes[np.argmax(np.abs(sizes))])
            if largest != 0.0 or number == 0:
                alone = self.base.make(largest * np.eye(len(self.base))[number])
                ramped.append(self._ramped(alone, sizes / largest if largest else np.zeros_like(sizes)))
        return tuple(ramped)

    def _ramped(self, mechanism: Mechanism, factors: Floats) -> Mechanism:
        return replace(mechanism, ramp=tuple(zip(self.times.tolist(), factors.tolist(), strict=True)))

    def proposal(self) -> Proposal:
        """The base with coefficients for each mode in the place of one that varies."""
        base, count = self.base, self.modes.shape[1]
        fixed, varying = list(self.fixed), list(base.varying)

        def wide(values: Floats, modes: Floats) -> Floats:
            return np.concatenate([values[fixed], np.repeat(modes[varying], count)])

        def elsewhere(centre: Floats, radius: float) -> Proposal:
            assert base.elsewhere is not None
            return replace(self, base=base.elsewhere(centre, radius)).proposal()

        none = np.zeros(len(base))
        return replace(
            base,
            make=lambda c: base.make(self.at(c, float(self.times[-1]))),
            mean=wide(base.mean, none),
            sd=wide(base.sd, base.sd),
            start=wide(base.start, none) if len(base.start) else base.start,
            nothing=wide(base.without, none),
            elsewhere=None if base.elsewhere is None else elsewhere,
            over_time=self,
        )


@dataclass(frozen=True, eq=False)
class Proposal:
    """Mechanisms of one kind at one place."""

    make: Callable[[Floats], Mechanism]  # from coefficients (k,) to the mechanism
    mean: Floats  # (k,), of the coefficients beforehand
    sd: Floats
    #: One of `Follows`. A smooth one does nothing at `start`; a switch has one coefficient, its share; a course is
    #: solved once, at `start`; what one that fades does at once is computed at `start`.
    follows: Follows = "proportional"
    #: (k,), about which a smooth one is differentiated; zero if proportional
    start: Floats = field(default_factory=lambda: np.zeros(0))
    nothing: Floats = field(default_factory=lambda: np.zeros(0))  # (k,), where it does nothing, `start` if not said
    patch: Patch | None = None  # what the case's own boundaries no longer hold
    #: Of what acts in one place: from another centre (3,) [m] and radius [m] to the same there; a patch that would
    #: have no face there stays as it is, and a ball that would hold no element is about the nearest one
    elsewhere: Callable[[Floats, float], Proposal] | None = None
    on_surface: bool = False  # whether that place is one of the surface
    #: Of a fading one: from coefficients (k,) and times since strain came (...) [s] to how many times the stress that
    #: it has at once at `start` is left (...), in proportion to the first of them; nothing is in the end
    history: Callable[[Floats, Floats], Floats] | None = None
    #: Of a course: from coefficients to how many times faster than at `start` all of it goes
    pace: Callable[[Floats], float] | None = None
    centre: Floats | None = None  # (3,), where it acts, if somewhere [m]
    radius: float | None = None  # [m]
    #: Smallest and largest radius of a scan [m]; the prior of the logarithm is uniform between them
    radii: tuple[float, float] | None = None
    region: str = ""  # where it acts in words
    #: Numbers of the coefficients that say how it acts, such as how fast, not how much: their standard deviations stay
    #: where those of the others are scaled
    unscaled: tuple[int, ...] = ()
    positive: tuple[int, ...] = ()  # numbers of the coefficients with a half-normal prior, never negative
    odds: str = "causes.mechanism"  # key of the belief of the odds that its kind acts
    declared: bool = False  # whether it acts on a node set of `Situation.unused`
    #: Numbers of the coefficients that may be functions of time: all of them where it is in proportion to them
    varying: tuple[int, ...] = ()
    #: Whether what acts at one time gives way to what acts at the next; else each coefficient has a ramp
    in_turns: bool = False
    only_over_time: bool = False  # whether it is looked for with a course alone
    #: What its coefficients mean, if some are functions of time: `make` is what acts in the end
    over_time: Varying | None = None

    def acting(self, c: Floats) -> tuple[Mechanism, ...]:
        """The mechanisms of coefficients (k,): one, or with ramps what acts over time."""
        return (self.make(c),) if self.over_time is None else self.over_time.mechanisms(c)

    @classmethod
    def of_one(
        cls,
        make: Callable[[float], Mechanism],
        mean: float,
        sd: float,
        follows: Follows = "proportional",
        start: float = 0.0,
        **where: object,
    ) -> Proposal:
        """A proposal with one coefficient."""
        numbers = (np.array([mean]), np.array([sd]))
        return cls(lambda c: make(float(c[0])), *numbers, follows, np.array([start]), **where)  # type: ignore[arg-type]

    @classmethod
    def switch(cls, mechanism: Mechanism, sd: float, follows: Follows = "switch", **where: Any) -> Proposal:
        """What is there or not; its one coefficient, the share, says how exactly that is simulated."""
        return cls.of_one(lambda _share: mechanism, 1.0, sd, follows, **where)

    def scales(self, factor: float) -> Floats:
        """Factors (k,) on prior standard deviations that scale those of amounts by a factor; 1 of the others."""
        scales = np.full(len(self), factor)
        scales[list(self.unscaled)] = 1.0
        return scales

    @property
    def without(self) -> Floats:
        """Coefficients (k,) with which it does nothing."""
        if len(self.nothing):
            return self.nothing
        return self.start if len(self.start) else np.zeros(len(self))

    @classmethod
    def in_balls(
        cls,
        make: Callable[[float, Place, float], Mechanism],
        sd: float,
        radii: Sequence[float],
        situation: Situation,
        varying: tuple[int, ...] = (),
    ) -> list[Proposal]:
        """Smooth ones of one coefficient, nothing at zero, in balls of some radii throughout the tissue.

        A ball that would hold no element is about the middle of the nearest one.

        `make` is from the coefficient, the centre [m] and the radius [m] to the mechanism; `radii` are over that of the
        body.
        """
        from scipy.spatial import cKDTree

        middles = cKDTree(situation.mesh.centres)
        range_of_radii = (min(radii) * situation.mesh.radius, max(radii) * situation.mesh.radius)

        def ball(centre: Floats, radius: float) -> Proposal:
            away, nearest = middles.query(centre)
            if away >= 2.0 * radius:
                # beside the body, or in a mesh that is too coarse for it: it would hold no element
                centre = situation.mesh.centres[nearest]
            x, y, z = centre.tolist()
            return cls.of_one(
                lambda coefficient: make(coefficient, (x, y, z), radius),
                0.0,
                sd,
                "smooth",
                elsewhere=ball,
                centre=centre,
                radius=radius,
                radii=range_of_radii,
                varying=varying,
            )

        return [ball(site, part * situation.mesh.radius) for site in situation.volume_sites for part in radii]

    @classmethod
    def along_axes(
        cls, make: Callable[[Place, float], Mechanism], sd: float, what: str, situation: Situation
    ) -> list[Proposal]:
        """Proportional ones of one coefficient along each axis of the anatomy.

        `make` is from the axis and the coefficient to the mechanism; `what` says to people what lies along the axis.
        """
        axes = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
        return [
            cls.of_one(partial(make, axis), 0.0, sd, region=f"{what} {name}")
            for name, axis in zip(situation.axes, axes, strict=True)
        ]

    @property
    def released(self) -> Patch:
        """The patch of what lets go."""
        assert self.patch is not None
        return self.patch

    @property
    def is_there_or_not(self) -> bool:
        """Whether it has no size, only a share that says how exactly it is simulated."""
        return self.follows == "switch" or self.is_release

    @property
    def is_release(self) -> bool:
        """Whether nodes that are held are released where it acts."""
        return self.follows == "release"

    @property
    def changes_in_time(self) -> bool:
        """Whether what it does changes while loads do not."""
        return self.follows in ("course", "fading")

    def __len__(self) -> int:
        return len(self.mean)
