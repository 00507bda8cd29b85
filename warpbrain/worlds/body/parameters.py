"""From the coefficients of a proposal to the parameters that a user knows, with units and standard deviations."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.inference.beliefs import belief
from warpbrain.physics.mechanism import Mechanism
from warpbrain.physics.proposal import Proposal
from warpbrain.physics.words import Smallest, Value
from warpbrain.worlds.body.effects import Effect
from warpbrain.worlds.body.places import RADII

#: Least probability of being in a range that is told from none.
_LEAST = 1e-30


def scanned_values(effects: Sequence[Effect], weights: Floats) -> tuple[Value, ...]:
    """Parameters that differ among proposals, such as a level or a radius: mean and standard deviation over them.

    `effects`: of one kind. `weights` (v,): their probabilities, with the sum 1.
    """
    numbers = [numbers_of(effect, np.zeros(effect.columns.shape[1])) for effect in effects]
    result = []
    for name, (_, unit) in numbers[0].items():
        values = np.array([of_effect[name][0] if name in of_effect else np.nan for of_effect in numbers])
        if np.isnan(values).any() or np.ptp(values) == 0.0:
            continue
        mean = float(weights @ values)
        # with the variance of a uniform distribution over the step between neighbours
        step = float(np.ptp(values)) / max(len(np.unique(values)) - 1, 1)
        result.append(Value(name, mean, float(np.sqrt(weights @ (values - mean) ** 2 + step**2 / 12.0)), unit))
    return tuple(result)


def values_of(effect: Effect, z: Floats, covariance: Floats) -> tuple[Value, ...]:
    """Parameters of the mechanism at coordinates (k,) with a covariance (k, k): to first order.

    The length of a vector follows its components, as `value_size`; of several numbers the first is `moduli_1`, and
    `moduli` what they are together, if that means anything.
    """
    if effect.proposed.is_there_or_not:
        return ()
    parameters = numbers_of(effect, z)
    # rounding may leave a covariance slightly indefinite
    spread, along = np.linalg.eigh(covariance)
    factor = along * np.sqrt(np.maximum(spread, 1e-18))
    shifted = [(numbers_of(effect, z + 0.1 * column), numbers_of(effect, z - 0.1 * column)) for column in factor.T]
    result = []
    for name, (value, unit) in parameters.items():
        change = np.array([(up[name][0] - down[name][0]) / 0.2 for up, down in shifted if name in up and name in down])
        sd = float(np.linalg.norm(change))
        if sd > 0.0:
            result.append(Value(name, value, sd, unit))
    return tuple(result)


def log_within_expected(effect: Effect, z: Floats, covariance: Floats) -> float:
    """Log probability that numbers of a mechanism are in the ranges outside of which they are not expected at all.

    The evidence of a prior that ends there is so many times that of one that does not (Gelfand, Smith and Lee 1992):
    a fit must not explain recordings by a Poisson ratio of 0.1. Of a half-normal prior that ratio is the probability
    of a positive coefficient a posteriori over that a priori (Klugkist and Hoijtink 2007). The logarithm of
    a radius has a uniform prior over the radii of a scan and their cells, with normal tails as wide as a cell beyond:
    a fit that is moved must not end at a radius that no scan would look for.

    `z` (k,), `covariance` (k, k): of the coefficients, a posteriori.
    """
    from scipy.special import ndtr

    total, specs = 0.0, effect.proposed.make(effect.proposed.mean).parameters()
    for value in values_of(effect, z, covariance):
        spec = specs.get(value.name)
        if spec is None or spec.kind != "number" or spec.expectation is None or spec.expectation.is_normal:
            continue
        low, high = ((end - value.value) / value.sd for end in spec.expectation.ends)
        total += math.log(max(float(ndtr(high) - ndtr(low)), _LEAST))
    proposed, c = effect.proposed, effect.coefficients(z)
    for number in proposed.positive:
        sd = proposed.sd[number]
        after, before = c[number] / (sd * math.sqrt(covariance[number, number])), proposed.mean[number] / sd
        total += math.log(max(float(ndtr(after)), _LEAST) / float(ndtr(before)))
    if proposed.radii is not None and proposed.radius is not None:
        smallest, largest = RADII[0] * proposed.radii[0], RADII[-1] * proposed.radii[1]
        beyond = math.log(max(smallest / proposed.radius, proposed.radius / largest, 1.0)) / math.log(RADII[-1])
        total -= 0.5 * beyond**2
    return total


def log_overlap(effect: Effect, z: Floats, covariance: Floats, alike: Sequence[Proposal]) -> float:
    """Log evidence of a fit under the priors of all proposals that are alike, over that under its own alone.

    Those that make the same of the same coefficients differ by their priors alone, such as about one relaxation time
    and about the next, which overlap. The linear model about the base sees but the middle of each. About a fit the
    likelihood is a Gaussian, the posterior over the prior, whose integral with each prior is known. All proposals are
    equally probable, and so are all sizes.

    `z` (k,), `covariance` (k, k): of the coefficients, a posteriori. `alike`: that of the effect among them, all of the
    usual size.
    """
    proposed, size = effect.proposed, effect.size
    posterior = covariance * np.outer(proposed.sd, proposed.sd)
    prior = np.diag(proposed.sd**-2.0)
    precision = np.linalg.inv(posterior) - prior
    information = np.linalg.solve(posterior, effect.coefficients(z)) - prior @ proposed.mean

    def log_evidence(other: Proposal) -> float:
        """Of the fit under the prior of another proposal, summed over sizes, but for a constant."""
        logs = []
        for of_size in effect.sizes:
            sd = other.scales(of_size) * other.sd
            joint, shifted = precision + np.diag(sd**-2.0), information + other.mean / sd**2
            explained = shifted @ np.linalg.solve(joint, shifted) - np.sum((other.mean / sd) ** 2)
            logs.append(0.5 * (explained - np.linalg.slogdet(joint)[1]) - np.log(sd).sum())
        return float(np.logaddexp.reduce(logs))

    own = log_evidence(replace(proposed, sd=proposed.sd / proposed.scales(size)))
    return float(np.logaddexp.reduce([log_evidence(other) for other in alike])) - own


def numbers_of(effect: Effect, z: Floats) -> dict[str, tuple[float, str]]:
    """Numbers of the mechanism at coordinates (k,), by name, with units; of what lets go its place."""
    centre, radius = effect.proposed.centre, effect.proposed.radius
    if effect.proposed.is_there_or_not and centre is not None and radius is not None:
        return {
            **{f"centre_{axis}": (x, "m") for axis, x in zip("xyz", centre.tolist(), strict=True)},
            "radius": (1e3 * radius, "mm"),
        }
    return mechanism_numbers(effect.proposed.make(effect.coefficients(z)))


def mechanism_numbers(mechanism: Mechanism) -> dict[str, tuple[float, str]]:
    """Numbers of a mechanism by name, with units."""
    parameters: dict[str, tuple[float, str]] = {}
    if mechanism.ramp:
        parameters["share"] = (mechanism.factor(), "")
    for name, spec in mechanism.parameters().items():
        value = getattr(mechanism, name)
        if value is None or isinstance(value, str):
            continue
        numbers = np.ravel(np.asarray(value, dtype=float)) / spec.si
        if len(numbers) == 1 or spec.adds_up:
            parameters[name] = (float(numbers.sum()), spec.unit)
        if spec.kind == "numbers" and len(numbers) > 1:
            parameters |= {f"{name}_{k}": (number, spec.unit) for k, number in enumerate(numbers.tolist(), 1)}
        if len(numbers) == 3 and spec.kind in ("vector", "position"):
            unit = spec.unit if spec.kind == "vector" else "m"
            for axis, number in zip("xyz", numbers.tolist(), strict=True):
                parameters[f"{name}_{axis}"] = (number, unit)
            if spec.kind == "vector":
                parameters[f"{name}_size"] = (float(np.linalg.norm(numbers)), unit)
    return parameters


def smallest_of(effect: Effect, whitened_length: float, seen: float, named: float) -> Smallest:
    """The sizes at which an effect has two detectabilities.

    `whitened_length`: its detectability per standard deviation of its first coefficient (of a switch, or a course: when
    it is there). `seen`, `named`: detectabilities at which it raises an alarm, and at which it is named; infinite if it
    never is.
    """
    part, part_named = (d / max(whitened_length, 1e-12) for d in (seen, named))
    size, unit, name = _size_at(effect, part)
    named_from = _size_at(effect, part_named)[0]
    if name == "share":
        # of what acts in full or not at all: a part of it is far from either
        return Smallest(size, unit, name, named_from)
    farthest = belief("checks.farthest")
    return Smallest(size, unit, name, named_from if part_named <= farthest else math.inf, part <= farthest)


def _size_at(effect: Effect, factor: float) -> tuple[float, str, str]:
    """Size, unit and parameter of an effect that is so many times one standard deviation of its first coefficient."""
    if effect.proposed.is_there_or_not or effect.columns_at is not None:
        return factor, "of being there", "share"
    z = np.zeros(effect.columns.shape[1])
    start = -effect.proposed.mean / effect.proposed.sd if effect.proposed.follows == "proportional" else z
    initial = numbers_of(effect, start)
    z = start.copy()
    z[0] += min(factor, 1e3)
    try:
        reached = numbers_of(effect, z)
    except Exception:  # a mechanism refuses sizes that cannot be
        return float("inf"), "", ""
    for name, (value, unit) in reached.items():
        if name in initial and abs(value - initial[name][0]) > 0.0:
            return (abs(value - initial[name][0]) if factor < 1e3 else float("inf")), unit, name
    return float("inf"), "", ""
