"""Where a mechanism acts and over which radius, as coordinates of which a fit has derivatives."""

import itertools
import math
from dataclasses import dataclass, replace

import numpy as np

from warpbrain.arrays import Floats, Int32s
from warpbrain.mesh.quality import principal_axes
from warpbrain.physics.proposal import Patch, Proposal
from warpbrain.recordings.closest import closest_points
from warpbrain.simulation.model import Model
from warpbrain.worlds.body.effects import Effect, Effects
from warpbrain.worlds.body.linearisation import Linearisation, Moment

#: Radii in a cell relative to that of the scan, whose radii are half as large again as each other.
RADII = (0.8, 1.0, 1.25)


@dataclass(frozen=True, eq=False)
class PlaceCoordinates:
    """Four coordinates of the place of a mechanism, zero where it is, each of standard deviation one beforehand.

    Of its centre along the principal axes of the body, in steps, back on the surface if it is of that; and the
    logarithm of its radius.
    """

    model: Model
    proposed: Proposal  # at a place
    step: float  # [m]

    def at(self, p: Floats) -> Proposal:
        """The proposal at coordinates (4,)."""
        proposed, mesh = self.proposed, self.model.mesh
        assert proposed.elsewhere is not None and proposed.centre is not None and proposed.radius is not None
        centre = proposed.centre + self.step * p[:3] @ principal_axes(mesh.points)
        if proposed.on_surface:
            centre = closest_points(centre[None], mesh.points, faces_for(self.model, proposed.patch)).position[0]
        return proposed.elsewhere(centre, proposed.radius * RADII[-1] ** float(p[3]))

    def effect_at(self, p: Floats, effect: Effect) -> Effect:
        """An effect of this proposal, whose standard deviations may be others, at coordinates (4,), in its columns."""
        there = self.at(p)
        return replace(effect, proposal=replace(there, sd=there.scales(effect.size) * there.sd))

    def columns(self, at: Linearisation, effect: Effect, z: Floats) -> Floats:
        """Derivatives (n, 4) of what is recorded, about a state where the effect acts with coefficients z (k,)."""
        c, varying, none = effect.coefficients(z), effect.proposed.over_time, np.zeros(4)

        def about(moment: Moment) -> Floats:
            here = c if varying is None else varying.at(c, moment.time)

            def base(p: Floats) -> Proposal:
                proposal = self.at(p)
                return proposal if proposal.over_time is None else proposal.over_time.base

            moving = Proposal(lambda p: base(p).make(here), none, np.ones(4), "smooth", none)
            [moved] = Effects(moment.at).of([moving], moving.make(none), columns_alone=True)
            return moved.columns

        return at.summed(about, self.proposed.make(self.proposed.mean).changes)


@dataclass(frozen=True, eq=False)
class LikelyPlaces:
    """A normal distribution of the coordinates of a place."""

    coordinates: PlaceCoordinates
    mean: Floats  # (4,)
    covariance: Floats  # (4, 4)

    def spread(self, effect: Effect) -> tuple[list[Effect], Floats]:
        """An effect at 81 places, and weights (81,) of these: Gauss and Hermite's rule of three points an axis.

        About the place where it is: that a linear model has a better one, to which no fit came, is uncertainty.
        """
        nodes = np.array(list(itertools.product((0.0, -1.0, 1.0), repeat=4)))
        weights = np.where(nodes == 0.0, 2.0 / 3.0, 1.0 / 6.0).prod(axis=1)
        squares, along = np.linalg.eigh(self.covariance + np.outer(self.mean, self.mean))
        ps = math.sqrt(3.0) * nodes @ (along * np.sqrt(np.maximum(squares, 0.0))).T
        return [self.coordinates.effect_at(p, effect) for p in ps], weights


def faces_for(model: Model, patch: Patch | None) -> Int32s:
    """Faces (k, 3) that are free, or that a patch is a part of."""
    boundary = model.mesh.boundary
    if patch is not None:
        return np.asarray(boundary[patch.held[boundary].all(axis=1)])
    held = np.asarray(model.constrained.all(axis=1))
    return np.asarray(boundary[~held[boundary].any(axis=1)])


def middles_of_faces(model: Model, patch: Patch | None) -> Floats:
    """Of `faces_for` (k, 3) [m]."""
    return np.asarray(model.mesh.points[faces_for(model, patch)].mean(axis=1))


def places_about(model: Model, proposed: Proposal, step: float) -> list[Proposal]:
    """Proposals a step [m] from another one along each principal axis, back on the surface if it is of that.

    And at the same place with other radii.
    """
    assert proposed.elsewhere is not None and proposed.centre is not None and proposed.radius is not None
    axes = principal_axes(model.mesh.points)
    centres = [proposed.centre + sign * step * axis for axis in axes for sign in (-1.0, 1.0)]
    if proposed.on_surface:
        middles = middles_of_faces(model, proposed.patch)
        nearest = {int(np.argmin(np.sum((middles - centre) ** 2, axis=1))) for centre in centres}
        centres = [middles[number] for number in sorted(nearest)]
    others = [proposed.elsewhere(proposed.centre, factor * proposed.radius) for factor in RADII if factor != 1.0]
    return [*others, *(proposed.elsewhere(centre, proposed.radius) for centre in centres)]
