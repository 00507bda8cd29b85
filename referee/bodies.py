"""Declared bodies that several cases share: load, where and when is recorded, declared noise. All else each case draws.

What a body declares is drawn as that of any case, before anything is drawn of what acts in it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from referee.errors import InputError
from referee.geometry import COARSE
from referee.plan import Planned
from referee.setting import Setting, draw_setting

#: What cases that share a body have of it.
_DECLARED = ("total", "moved", "sigma", "declares_sigma", "points", "checks", "surface", "times", "sites")
#: One body of so many of a geometry is recorded at several times: about the share of other cases that are.
_TIMED = 4


def draw_bodies(count: int, geometries: Sequence[str], seed: int, coarse: bool) -> list[Setting]:
    """Settings of which cases take what is declared.

    Parameters
    ----------
    count : int
    geometries : sequence of str
        In turn.
    seed : int
    coarse : bool
        Whether there is one more, whose declared mesh is too coarse.
    """
    made = []
    for number in range(count + coarse):
        turn, which = divmod(number, len(geometries))
        timed = turn % _TIMED == _TIMED - 1
        geometry = geometries[which] if number < count else "phantom"
        drawn = draw_setting(np.random.default_rng([seed, count, number]), geometry, timed)
        mesh = geometry if number < count else COARSE
        made.append(replace(drawn, mesh=mesh, times=drawn.times if timed else (), sites=drawn.seed))
    return made


def on_body(setting: Setting, body: Setting) -> Setting:
    """A setting with what a body declares."""
    return replace(setting, **{name: getattr(body, name) for name in _DECLARED})


def assigned(plans: Sequence[Planned], bodies: Sequence[Setting], seed: int) -> list[int]:
    """Number of the body of each case: of those that fit it the one with the fewest so far, at random of several.

    Those that fit few bodies choose first, so that in the end all bodies have about as many cases.

    Raises
    ------
    InputError
        If no body fits a case.
    """
    random = np.random.default_rng([seed, len(bodies)])
    fitting = [[k for k, body in enumerate(bodies) if _fits(plan, body)] for plan in plans]
    for plan, own in zip(plans, fitting, strict=True):
        if not own:
            raise InputError(f"no body fits {' and '.join(plan.names) or plan.kind} in {plan.geometry}: more bodies?")
    count = np.zeros(len(bodies), dtype=np.int64)
    chosen = [0] * len(plans)
    for case in sorted(random.permutation(len(plans)).tolist(), key=lambda case: len(fitting[case])):
        own = np.array(fitting[case])
        least = own[count[own] == count[own].min()]
        chosen[case] = int(random.choice(least))
        count[chosen[case]] += 1
    return chosen


def _fits(plan: Planned, body: Setting) -> bool:
    return (
        plan.geometry == body.geometry
        and (plan.names == ("coarse",)) == (body.mesh == COARSE)
        and (bool(body.times) or "viscoelasticity" not in plan.names)
        # that noise is not what is declared needs a declaration
        and (body.declares_sigma or plan.names != ("noise",))
    )
