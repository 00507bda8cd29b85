"""The optimal analyst: who knows how cases are drawn, but not this draw, and has the referee's own mechanics.

Of each label its body without effects is solved again, all that is not known of it and a few hundred draws of each
cause are linearised about that state, and residuals like those of the case are drawn anew: the true change, to first
order and as large as it is, noise, mistakes, registration, tissue. Of each the posterior over sets of causes follows,
with the shares of a scored set as prior. Since the true place is among the draws, it is a ceiling: nobody is right more
often.
"""

from __future__ import annotations

import json
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from referee.detectability import Spread, covariance
from referee.diagnoses import NOT_PHYSICS
from referee.draw import NOISY, OUTSIDE, RIGID_SHIFT, RIGID_TURN, UNEVEN
from referee.effects.effect import unit
from referee.equilibrium import Balance, balance_in_steps
from referee.labels import effects_of, setting_of
from referee.library import Draws, Forces, draws_of, library
from referee.linear_response import LinearResponse
from referee.make import steps_of
from referee.mistakes import draw
from referee.posterior import Analyst
from referee.problem import Problem
from referee.sensing import place_sensors
from referee.setting import EACH, FIELD, NOISE, OVERALL, mean_square
from referee.sight import Sight
from referee.sizing import first_order, spanning
from referee.threads import single as one_thread
from referee.truth import cap_force_of
from referee.unknowns import MODES, unknown_forces
from warpbrain.terminal.quiet import start_warp_quietly

Floats = NDArray[np.float64]
Random = np.random.Generator

#: Residuals of each case, rigid motions that stand for all, and sets below which probability are not written.
RESIDUALS, MOTIONS, LEAST = 16, 200, 1e-3
#: Traps that are hypotheses.
MODELLED = ("registration", "noise", "stiffness")


@dataclass(frozen=True, eq=False)
class Known:
    """What the analyst knows of a case beside its residuals.

    Attributes
    ----------
    sight : Sight
    lower : (rows, rows) array
        Factor of the covariance of all that is not known: rows are its products with rows in units of that.
    noise : (rows, rows) array
        Covariance of noise alone in these units.
    field : (modes, rows) array
        Modes of the stiffness field in these units.
    named : dict of str to Draws
    nameless : Draws
    """

    sight: Sight
    lower: Floats
    noise: Floats
    field: Floats
    named: dict[str, Draws]
    nameless: Draws

    def whiten(self, rows: Floats) -> Floats:
        """From rows (k, rows) to units of all that is not known."""
        return whitened(self.lower, rows)


def whitened(lower: Floats, rows: Floats) -> Floats:
    """Rows (k, rows) in units in which noise with this factor (rows, rows) of its covariance is `N(0, I)`."""
    return np.asarray(solve_triangular(lower, rows.T, lower=True)).T


def analyse(labels: Mapping[str, Mapping[str, Any]], out: Path, workers: int) -> None:
    """Write what the analyst makes of each case, `out/CASE.json`; cases that are there are kept."""
    out.mkdir(parents=True, exist_ok=True)
    waiting = {name: label for name, label in labels.items() if not (out / f"{name}.json").exists()}
    with ProcessPoolExecutor(max_workers=workers, mp_context=get_context("spawn"), initializer=one_thread) as pool:
        jobs = {pool.submit(analysed, label): name for name, label in waiting.items()}
        for count, job in enumerate(as_completed(jobs), start=1):
            analysis = job.result()
            (out / f"{jobs[job]}.json").write_text(json.dumps(analysis) + "\n", encoding="ascii")
            print(f"{count} of {len(jobs)}: {jobs[job]} in {analysis['seconds']:.0f} s", flush=True)


def analysed(label: Mapping[str, Any]) -> dict[str, Any]:
    """The analyst's posterior over sets of causes for residuals like those of a label.

    Returns
    -------
    dict
        `conditional`: of each effect how much it stands out given the others; `draws`: of each residual the p-value of
        nothing and the sets of causes with their probabilities; `seconds` of processor time.
    """
    start_warp_quietly()
    started = time.process_time()
    if label["kind"] == "trap" and label["names"][0] not in MODELLED:
        return {"case": label["case"], "conditional": [], "draws": [], "seconds": 0.0}
    setting = setting_of(label)
    random = np.random.default_rng([setting.seed, 11])
    problem = setting.problem()
    base = balance_in_steps(problem, steps_of(len(label["attempts"])))
    sight = Sight(setting, place_sensors(setting), base.u, cap_force_of(problem, base.u))
    known, true, given = _known(label, random, problem, base, sight)
    residuals = _residuals(label, random, known, true)
    return {
        "case": label["case"],
        "conditional": given,
        "draws": posteriors(residuals, known, random),
        "seconds": round(time.process_time() - started, 1),
    }


def _known(
    label: Mapping[str, Any], random: Random, problem: Problem, base: Balance, sight: Sight
) -> tuple[Known, Floats, list[float]]:
    setting = sight.setting
    response = LinearResponse(sight, base, problem.body.nodes("superior"))
    tissues, others = (response.rows(np.stack(forces)) for forces in unknown_forces(problem, base))
    unknown = np.concatenate([OVERALL * tissues.sum(axis=0, keepdims=True), EACH * tissues, others])
    whole = covariance(sight, unknown)
    lower = np.linalg.cholesky(whole)
    whiten = partial(whitened, lower)
    named, nameless = library(random, setting, Forces(problem, base), response, whiten)
    effects = effects_of(label)
    changes = [first_order(effect, problem, base, setting.times) for effect in effects]
    rows = np.stack([sight.rows(change) for change in changes]) if changes else np.zeros((0, len(lower)))
    true = whiten(rows)
    wide = [
        np.stack([sight.rows(part) for part in spanning(effect, change, problem, base, setting.times)])
        for effect, change in zip(effects, changes, strict=True)
        if len(effects) > 1
    ]
    spread = Spread(sight, whole)
    given = [spread.d(own, np.concatenate([rows[:0], *wide[:k], *wide[k + 1 :]])) for k, own in enumerate(rows)]
    for row, effect in zip(true, effects, strict=True):
        own = draws_of(row[None], np.array([np.inf]), fixed=False, both=True)
        if effect.kind in named:
            named[effect.kind] = named[effect.kind].and_also(own)
        elif effect.kind in OUTSIDE:
            nameless = nameless.and_also(own)
        if "traction" in effect.also:
            named["traction"] = named["traction"].and_also(own)
    modes = whiten(others[:MODES])
    noise = whiten(whiten(sight.noise).T)
    if len(true) == 1:
        # as large as it is, of which these are the first order
        true *= float(np.linalg.norm(whiten(_recorded(label, sight)[None]))) / float(np.linalg.norm(true))
    return Known(sight, lower, noise, modes, named, nameless), true.sum(axis=0), given


def _recorded(label: Mapping[str, Any], sight: Sight) -> Floats:
    """Rows (rows,) of all that the effects of a label change, in full."""
    points, wall = np.array(label["clean_effect_m"]), np.array(label["clean_effect_on_wall_m"]).reshape(-1, 3)
    return sight.stacked(points, wall, np.array(label["clean_effect_n"]))


def _residuals(label: Mapping[str, Any], random: Random, known: Known, true: Floats) -> Floats:
    """Residuals (k, rows) like those of the case."""
    wrong = np.zeros((RESIDUALS, len(true)))
    numbers = known.sight.numbers
    chosen = random.random((RESIDUALS, len(numbers))) < known.sight.setting.gross
    wrong[:, numbers] = chosen[..., None] * draw(random, chosen.shape)
    mistakes = known.whiten(wrong)
    w = true + random.normal(size=(RESIDUALS, len(true))) + mistakes
    if label["kind"] != "trap":
        return w
    trap = label["names"][0]
    if trap == "registration":
        shift, turn = (np.array(label["setting"][name]) for name in ("shift", "turn"))
        return w + known.whiten(known.sight.moved_rigidly(shift, turn)[None])
    if trap == "noise":
        return mistakes + random.normal(size=w.shape) @ np.linalg.cholesky(_noisy(known)).T
    return w + random.normal(size=(len(w), len(known.field))) @ _uneven(known)


def _noisy(known: Known) -> Floats:
    return np.eye(len(known.noise)) + (NOISY**2 / mean_square(NOISE) - 1.0) * known.noise


def _uneven(known: Known) -> Floats:
    return np.sqrt(UNEVEN**2 / mean_square(FIELD) - 1.0) * known.field


def posteriors(residuals: Floats, known: Known, random: Random) -> list[dict[str, Any]]:
    """Of each residual (k, rows) the p-value of nothing, and sets of causes with their probabilities."""
    motions = [
        known.sight.moved_rigidly(
            random.uniform(*RIGID_SHIFT) * unit(random.normal(size=3)),
            random.uniform(*RIGID_TURN) * unit(random.normal(size=3)),
        )
        for _ in range(MOTIONS)
    ]
    moved, uneven = known.whiten(np.stack(motions)) / np.sqrt(MOTIONS), _uneven(known)
    plain = np.eye(residuals.shape[1])
    # in the order of `MODELLED`
    traps = [plain + moved.T @ moved, _noisy(known), plain + uneven.T @ uneven]
    analyst = Analyst(known.lower, known.sight.numbers, known.sight.setting.gross, known.named, known.nameless, traps)
    analyses = []
    for w in residuals:
        p, p_value = analyst.posterior(w)
        sets: dict[tuple[str, ...], float] = {}
        for causes, value in p.items():
            short = (NOT_PHYSICS,) if NOT_PHYSICS in causes else causes
            sets[short] = sets.get(short, 0.0) + value
        kept = [[list(causes), round(value, 4)] for causes, value in sets.items() if value > LEAST]
        analyses.append({"p_value": p_value, "sets": sorted(kept, key=_by_probability)})
    return analyses


def _by_probability(row: Sequence[Any]) -> float:
    return -float(row[1])
