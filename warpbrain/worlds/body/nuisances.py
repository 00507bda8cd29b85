"""Nuisances, which may explain residuals without any missing physics: columns over the sensors, one per coordinate.

Tissue (its prior), stiffness that varies within it, compressibility, the shape of its law, how large the known loads
were, a rigid error of registration, and the error of the mesh. A cause is credited only with what these cannot explain.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar, NamedTuple

import numpy as np

from warpbrain.arrays import Floats, Ints
from warpbrain.estimation.finer_mesh import Discretisation
from warpbrain.estimation.parameters import Gaussian
from warpbrain.estimation.registration import moved_back, moved_back_columns, registration_of
from warpbrain.inference.beliefs import belief, beliefs
from warpbrain.physics.laws import Law
from warpbrain.physics.laws.mooney_rivlin import MooneyRivlin
from warpbrain.physics.laws.ogden import NEO_HOOKEAN, Ogden
from warpbrain.physics.mechanism import Mechanism
from warpbrain.physics.mechanisms import mechanisms
from warpbrain.physics.proposal import Proposal
from warpbrain.worlds.body.boundaries import boundary_columns, visible_modes
from warpbrain.worlds.body.effects import Effect, Effects
from warpbrain.worlds.body.linearisation import Linearisation, Moment
from warpbrain.worlds.body.mesh_error import MeshErrors, expected_answer
from warpbrain.worlds.body.sensors import Sensors, kernel_columns, row_products, spread_points
from warpbrain.worlds.body.states import Hypothesis, States
from warpbrain.worlds.body.stiffness_field import FieldSizes

#: The family of what is not known of the shape of tissues' laws.
LAW = "shape of the law"
#: Beliefs of its first columns, each of which is a mechanism that every tissue has to a degree.
_ALWAYS = ("tissue.volume", "tissue.exponent")
#: The family of stiffness that varies from place to place.
FIELD = "stiffness field"
#: The family of what is not known of the case's loads.
LOADS = "known loads"
#: The family of what is not known of where supports end, and of how nodes share a load.
BOUNDARIES = "boundaries"
#: The family of what is not known of the mesh's error, and that of mechanisms' shares of it, which only fits have.
UNKNOWN_MESH, MESH_SHARE = "mesh, unknown", "mesh, of mechanisms"
#: The family of what is not known of the shape of mechanisms in one place, which only fits have; the number of
#: mechanisms, and of modes of each: two other radii, and a neighbouring place to both sides along each axis.
SHAPES, SHAPED_EFFECTS, SHAPE_MODES = "shape of mechanisms", 3, 8
#: Exponent of what stiffens in both directions.
_STIFFENS = 8.0
#: Step of a difference in `theta`.
_STEP = 1e-3


@dataclass(frozen=True, eq=False)
class Nuisances:
    """All of them."""

    #: (n, k), by the name of each family of nuisances: change of what is recorded by one standard deviation of each.
    families: Mapping[str, Floats]
    anchors: Floats  # (a, 3), points [m] of the kernel functions of the unknown part of the mesh's error
    fraction: float  # that part, relative to the displacement
    displacement: Floats  # (n,), of the state at each row [m]; zero of forces
    relative: Floats  # (n, k), columns of that part if it were as large as a displacement of 1 m
    boundary_modes: Floats  # (b, k), of `boundary_columns`, that are kept
    field_sizes: FieldSizes  # of which the typical one is that of the stiffness field's family

    @property
    def columns(self) -> Floats:
        """Of all, side by side (n, q)."""
        return np.concatenate(list(self.families.values()), axis=1)

    def weakened(self) -> Nuisances:
        """The same with columns that are next to nothing, so that they explain nothing."""
        families = {name: 1e-9 * columns for name, columns in self.families.items()}
        return replace(self, families=families, relative=1e-9 * self.relative)

    def with_fraction(self, fraction: float) -> Nuisances:
        """The same with another size of the unknown part of the mesh's error."""
        unknown = self.families[UNKNOWN_MESH] * (fraction / self.fraction)
        return replace(self, families={**self.families, UNKNOWN_MESH: unknown}, fraction=fraction)

    def with_family(self, name: str, columns: Floats, of_family: Floats) -> Floats:
        """Columns (n, q + k) that begin with these nuisances, with others (n, j) of one family."""
        changed = columns.copy()
        changed[:, self.part(name)] = of_family
        return changed

    def with_field(self, columns: Floats, factor: float) -> Floats:
        """Columns (n, q + k), or coordinates (1, q + k), those of the stiffness field times a factor."""
        return self.with_family(FIELD, columns, factor * columns[:, self.part(FIELD)])

    def columns_with_field(self, number: int) -> Floats:
        """Columns (n, q) of all, with the stiffness field of one of its sizes, by its index in `field_sizes`."""
        return self.with_field(self.columns, self.field_sizes.relative[number])

    @property
    def shapes(self) -> Ints:
        """Where the columns of the shapes of laws and of mechanisms are."""
        return np.r_[self.part(LAW), self.part(SHAPES)]

    def without_shapes_of(self, number: int, columns: Floats) -> Floats:
        """Columns (n, q + k), or coordinates (1, q + k), without the shape of one of some mechanisms."""
        of_each = np.split(columns[:, self.part(SHAPES)], SHAPED_EFFECTS, axis=1)
        if number >= SHAPED_EFFECTS:
            return columns
        return self.with_family(
            SHAPES, columns, np.hstack([*of_each[:number], *of_each[number + 1 :], 0.0 * of_each[0]])
        )

    def coordinates(self, prior: Gaussian, hypothesis: Hypothesis) -> Floats:
        """Coordinates (q,) of the tissue, by its prior, and of the field of a hypothesis; the others are zero."""
        z = np.zeros(self.columns.shape[1])
        z[self.part("tissue")] = np.linalg.solve(prior.factor, hypothesis.theta - prior.mean)
        z[self.part(FIELD)] = hypothesis.field
        return z

    def part(self, name: str) -> slice:
        """Where the columns of a family are."""
        at = 0
        for family, columns in self.families.items():
            width = columns.shape[1]
            if family == name:
                return slice(at, at + width)
            at += width
        raise KeyError(name)


def nuisances_at(
    at: Linearisation,
    states: States,
    theta: Floats,
    prior: Gaussian,
    effects: Effects,
    mesh_errors: MeshErrors | None,
    like: Nuisances | None = None,
) -> Nuisances:
    """The nuisances of a state.

    `theta` (p,): of the tissues there.
    `prior`: of `theta`.
    `effects`: at that state.
    `mesh_errors`: the state on a finer mesh less the state; None: the mesh is taken for exact.
    `like`: of other sensors, so that coordinates mean the same; else the unknown part of the mesh's error is the
    largest that is believed.
    """
    sensors, boundaries = at.sensors, boundary_columns(at)
    if like is None:
        places = sensors.positions[sensors.is_displacement]
        anchors = places[spread_points(places, belief("mesh.alike") * sensors.radius, 60)]
        fraction, modes = float(beliefs("mesh.unknown").max()), visible_modes(boundaries)
    else:
        anchors, fraction, modes = like.anchors, like.fraction, like.boundary_modes
    families = {
        "tissue": tissue_columns(at, states, theta, prior) + mesh_by_tissue(sensors, mesh_errors),
        FIELD: field_columns(at, states),
        LAW: law_columns(effects, states),
        LOADS: load_columns(at),
        BOUNDARIES: boundaries @ modes,
        "registration": sensors.rigid * registration_of(states.case).deviations,
        SHAPES: np.zeros((len(sensors), SHAPED_EFFECTS * SHAPE_MODES)),
    }
    if mesh_errors is not None:
        error = mesh_errors.error
        answer = sensors.share * sensors.answer(error.u, error.reactions)
        families["mesh"] = Discretisation().deviation * answer[:, None]
        families[MESH_SHARE] = np.zeros((len(sensors), 1))
    displacement, relative = _displacement(at), _alike(sensors, anchors)
    families[UNKNOWN_MESH] = fraction * displacement[:, None] * relative
    return Nuisances(families, anchors, fraction, displacement, relative, modes, states.field_sizes)


def tissue_columns(at: Linearisation, states: States, theta: Floats, prior: Gaussian) -> Floats:
    """What one standard deviation of each parameter of the tissues changes of what is recorded: (n, p)."""

    def about(moment: Moment) -> Floats:
        state, system = moment.at, moment.at.system
        forces = np.zeros((len(theta), system.size, 3))
        for k in range(len(theta)):
            for sign in (-1.0, 1.0):
                shifted = theta.copy()
                shifted[k] += sign * _STEP
                system.set_model(system.model.with_materials(states.parameters.materials(shifted)))
                forces[k] -= sign * state.internal_forces() / (2.0 * _STEP)
        system.set_model(system.model.with_materials(states.parameters.materials(theta)))
        return state.answers(forces) @ prior.factor

    return at.summed(about, "stiffness")


def field_columns(at: Linearisation, states: States) -> Floats:
    """What one standard deviation of each mode of the stiffness field changes of what is recorded: (n, k)."""
    return at.summed(lambda moment: moment.at.answers_of_elements(moment.at.element_forces, states.modes), "stiffness")


def law_columns(effects: Effects, states: States) -> Floats:
    """What another Poisson ratio, exponent, share of the second invariant and stiffening change: (n, 4)."""

    def shape(of: str) -> Proposal:
        return Proposal.of_one(lambda share: _Share(share=share, of=of), 0.5, belief(f"tissue.{of}"), "smooth", 0.5)

    proposals = [*(_always(states, key) for key in _ALWAYS), shape("second_invariant"), shape("stiffening")]
    return np.concatenate([effect.columns for effect in effects.of(proposals, columns_alone=True)], axis=1)


class SharedParameter(NamedTuple):
    """A parameter of tissues' laws that is a nuisance and the coefficient of an effect."""

    column: int  # its number in the family `LAW`
    ratio: float  # standard deviation that it has as a nuisance, relative to that of the effect's coefficient


def shared_parameter(effect: Effect) -> SharedParameter | None:
    """The parameter of the law that is the coefficient of an effect, such as Ogden's exponent; None if none is.

    The effect stands for it, with a wider prior. The nuisance beside it would be the same parameter once more, which
    acts linearly.
    """
    proposal = effect.proposed
    key = proposal.make(proposal.mean).always if len(proposal.mean) == 1 else ""
    if key not in _ALWAYS or proposal.over_time is not None:
        return None
    return SharedParameter(_ALWAYS.index(key), belief(key) / float(proposal.sd[0]))


def other_volume(states: States) -> Proposal:
    """Tissue that is more or less compressible than the case says, as much in all tissues."""
    return _always(states, "tissue.volume")


def _always(states: States, key: str) -> Proposal:
    """The proposal of the mechanism that every tissue has to a degree given by a belief."""
    [mechanism] = [candidate for candidate in mechanisms().values() if candidate.always == key]
    return mechanism.about_law(states.case.poisson, belief(key))


def mesh_by_tissue(sensors: Sensors, mesh_errors: MeshErrors | None) -> Floats:
    """Change (n, p) of the mesh's error by one standard deviation of each tissue parameter; 0 for an exact mesh."""
    if mesh_errors is None:
        return np.zeros((len(sensors), 1))
    return np.column_stack([expected_answer(sensors, change) for change in mesh_errors.by_tissue])


@dataclass(frozen=True, kw_only=True)
class _Share(Mechanism):
    """A law with a share of the second invariant, or of one that stiffens alike in compression and in tension."""

    share: float
    of: str
    kind: ClassVar[str] = "shape of the law"
    sentence: ClassVar[str] = "The law has another shape."

    def substitute(self, label: int, law: Law, poisson: float, formulation: str) -> tuple[Law, float, str]:
        """See `warpbrain.physics.mechanism.Substituting`; what stiffens is Ogden's law of three terms."""
        mu, share = law.shear_modulus, self.share
        if self.of == "second_invariant":
            return MooneyRivlin(0.5 * mu * (1.0 - share), 0.5 * mu * share), poisson, formulation
        exponents, shares = (NEO_HOOKEAN, _STIFFENS, -_STIFFENS), (1.0 - share, 0.5 * share, 0.5 * share)
        moduli = tuple(2.0 * mu * part / alpha for part, alpha in zip(shares, exponents, strict=True))
        return Ogden(moduli, exponents), poisson, formulation


def load_columns(at: Linearisation) -> Floats:
    """All known loads larger or smaller by one factor, and all prescribed displacements: (n, k)."""

    def about(moment: Moment) -> Floats:
        state, model = moment.at, moment.at.system.model
        columns = np.zeros((len(state.sensors), 2))
        columns[:, 0] = state.answers(model.external_forces())
        if model.prescribed.any():
            forces = (state.stiffness @ model.prescribed.ravel()).reshape(-1, 3)
            direct = state.sensors.answer(model.prescribed, np.where(model.constrained, forces, 0.0))
            columns[:, 1] = direct + state.answers(np.where(model.constrained, 0.0, -forces))
        return belief("loads.size") * columns

    columns = at.summed(about, "loads")
    return columns[:, columns.any(axis=0)]


def _displacement(at: Linearisation) -> Floats:
    """Of the state at each row (n,) [m], counted from its reference; zero of forces."""
    from scipy.spatial import cKDTree

    sensors = at.sensors
    rows = sensors.is_displacement
    moved = np.zeros((len(sensors), 3))
    if not rows.any():
        return np.zeros(len(sensors))
    nearest = np.zeros(len(sensors), dtype=np.int64)
    nearest[rows] = cKDTree(at.system.model.mesh.points).query(sensors.positions[rows])[1]
    for moment in at.moments:
        moved[moment.rows] += moment.sign * moment.at.u[nearest[moment.rows]]
    return np.where(rows, np.linalg.norm(moved, axis=1), 0.0)


def _alike(sensors: Sensors, anchors: Floats) -> Floats:
    """Columns (n, k) of a displacement of 1 m in any direction, correlated among neighbours."""
    rows = np.flatnonzero(sensors.is_displacement)
    columns = np.zeros((len(sensors), 3 * len(anchors)))
    if len(rows):
        weights = kernel_columns(sensors.positions[rows], anchors, belief("mesh.alike") * sensors.radius)
        columns[rows] = row_products(weights, sensors.directions[rows])
    return columns


class RigidMotion:
    """The motion that recordings are taken to have been moved by, as coordinates of a fit.

    `states`: by whose motion sensors are realigned. `part`: of the coordinates.
    """

    def __init__(self, states: States, nuisances: Nuisances) -> None:
        self.part = nuisances.part("registration")
        self._deviations = registration_of(states.case).deviations
        self._realigned, self._centre = states.motion, states.centre
        # columns that explain nothing stay so (`Nuisances.weakened`)
        self._explains = bool(np.linalg.norm(nuisances.columns[:, self.part]) > 1e-6 * self._deviations.min())

    def change(self, sensors: Sensors, z: Floats) -> Floats:
        """What another motion than that of the sensors adds to their residuals (n,), at coordinates (q,)."""
        if not self._explains:
            return np.zeros(len(sensors))
        moved = moved_back(self._as_recorded(sensors), self._motion(z), self._centre) - sensors.positions
        return self._along(sensors, moved[:, :, None])[:, 0]

    def renewed(self, columns: Floats, sensors: Sensors, z: Floats) -> Floats:
        """Columns (n, q) with those of the motion about coordinates (q,)."""
        if not self._explains:
            return columns
        columns = columns.copy()
        by_motion = moved_back_columns(self._as_recorded(sensors), self._motion(z), self._centre)
        columns[:, self.part] = -self._along(sensors, by_motion) * self._deviations
        return columns

    def _motion(self, z: Floats) -> Floats:
        return np.asarray(z[self.part] * self._deviations)

    def _as_recorded(self, sensors: Sensors) -> Floats:
        """Places (n, 3) before they were realigned; NaN of forces."""
        from scipy.spatial.transform import Rotation

        turned = Rotation.from_rotvec(self._realigned[3:]).apply(sensors.positions - self._centre)
        return np.asarray(turned + self._centre + self._realigned[:3])

    @staticmethod
    def _along(sensors: Sensors, vectors: Floats) -> Floats:
        """Components (n, k) of ways (n, 3, k) in the directions of the sensors; zero of forces."""
        rows = sensors.is_displacement
        components = np.zeros((len(sensors), vectors.shape[2]))
        components[rows] = np.einsum("nj,njk->nk", sensors.directions[rows], vectors[rows])
        return components
