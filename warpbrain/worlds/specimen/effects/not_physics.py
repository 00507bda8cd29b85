"""Tests that are far from what they say: ends that slip or stick, a drifting zero, specimens of another stiffness."""

from __future__ import annotations

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.cases.case import Case
from warpbrain.inference.beliefs import belief
from warpbrain.inference.causes import Kind
from warpbrain.physics.proposal import NotTestableError
from warpbrain.worlds.specimen.actions import Action, Baseline, Effect, Variant
from warpbrain.worlds.specimen.protocol import Protocol

FRICTION, DRIFT, UNLIKE = "end friction", "drift of the zero", "unlike specimens"


def friction(case: Case, protocol: Protocol) -> Effect:
    """A share of the way from one kind of ends to the other, of axial tests."""
    assert case.specimen is not None
    if not any(test.mode == "axial" for test in protocol.tests if test.fitted):
        raise NotTestableError("needs an axial test")
    glued = case.specimen.grips == "glued"

    def act(share: float, rows: Baseline) -> Action:
        axial = rows.protocol.mask([k for k, test in enumerate(rows.protocol.tests) if test.mode == "axial"])
        part = float(np.clip(share, 0.0, 1.0))
        sticks = 1.0 - part if glued else part
        whole = rows.glued if glued else np.ones(len(rows.protocol))
        return Action(factor=np.where(axial, (1.0 + sticks * (rows.sticking() - 1.0)) / whole, 1.0))

    variant = Variant.of_one(act, belief("specimen.largest_slip"), True)
    sentence = "The ends of the specimen slip." if glued else "The ends of the specimen stick to the platens."
    return Effect(FRICTION, Kind.NOT_PHYSICS, sentence, ("share",), ("",), (variant,))


def drift(case: Case, protocol: Protocol) -> Effect:
    """Of each chain a parabola over its time; of tests without times a constant."""
    names = [
        f"{protocol.tests[chain.tests[0]].name}, {shape}"
        for chain in protocol.chains
        for shape in (("constant",) if chain.time is None else ("constant", "line", "parabola"))
    ]

    def act(c: Floats, rows: Baseline) -> Action:
        return Action(added=_drifts(rows.protocol) @ c)

    variant = Variant.of_columns(act, belief("specimen.largest_drift"), len(names))
    units = ("of the largest stress",) * len(names)
    return Effect(
        DRIFT, Kind.NOT_PHYSICS, "The zero of the force drifts, or is wrong.", tuple(names), units, (variant,)
    )


def _drifts(protocol: Protocol) -> Floats:
    columns = []
    for chain in protocol.chains:
        shapes = [np.ones(len(chain.strain))]
        if chain.time is not None:
            s = (chain.time - chain.time[0]) / max(float(np.ptp(chain.time)), 1e-12)
            shapes += [s, s * (1.0 - s)]
        own = np.zeros((len(protocol), len(shapes)))
        own[protocol.mask(chain.tests)] = np.column_stack(shapes)
        columns.append(max(protocol.tests[k].peak for k in chain.tests) * own)
    return np.concatenate(columns, axis=1)


def unlike(case: Case, protocol: Protocol) -> Effect:
    """A factor of the stress of each specimen."""
    if len(protocol.specimens) < 2:
        raise NotTestableError("needs tests of several specimens ([[recording]] specimen)")

    def act(c: Floats, rows: Baseline) -> Action:
        return Action(factor=np.exp(specimen_rows(rows.protocol) @ c))

    count = len(protocol.specimens)
    variant = Variant.of_columns(act, belief("specimen.largest_unlike"), count)
    names = tuple(f"ln stiffness of {name or 'the unnamed'}" for name in protocol.specimens)
    return Effect(UNLIKE, Kind.NOT_PHYSICS, "The specimens are not of one stiffness.", names, ("",) * count, (variant,))


def specimen_rows(protocol: Protocol) -> Floats:
    """Which rows (n, specimens) are of which specimen, 0 or 1."""
    of = np.concatenate([np.full(len(test.strain), protocol.specimens.index(test.specimen)) for test in protocol.tests])
    return (of[:, None] == np.arange(len(protocol.specimens))).astype(float)
