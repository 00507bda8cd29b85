"""Makes a set of cases over processes: folders for the tool, sealed labels apart from them."""

from __future__ import annotations

import hashlib
import shutil
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from referee.bodies import assigned, draw_bodies, on_body
from referee.draw import WANTED, draw_effect, trapped, wanted
from referee.equilibrium import NoTruth
from referee.folder import write_folder
from referee.labels import label_of, seal
from referee.plan import BOTH, Planned, planned
from referee.sealed import write_commitments
from referee.setting import Setting, draw_setting
from referee.sizing import Wish
from referee.threads import single
from referee.truth import LEAST, Truth, solve_truth
from warpbrain.terminal.quiet import start_warp_quietly

#: Rooms of a set.
CASES, LABELS = "cases", "labels"
#: Draws of a case whose load is put on at once, draws after them whose load is put on in steps, and these steps. What
#: has a truth among the first stays as it is.
ATTEMPTS, IN_STEPS, _STEPS = 12, 12, 4
#: Draws of which each effect must stand out by as much as is wanted at least.
STRICT = 4
#: Processor time for one draw at most [s], after which it is given up.
LIMIT = 90.0


def seed_of(text: str) -> int:
    """Number of a seed that is any text, such as the hash of the commit that froze the tool."""
    return int.from_bytes(hashlib.sha256(text.encode()).digest()[:6], "big")


def make_set(
    which: str, count: int, out: Path, geometries: Sequence[str], workers: int, seed: str, bodies: int | None = None
) -> list[str]:
    """Make a set; cases that are there already are kept, so that an interrupted set is finished by the same command.

    Parameters
    ----------
    which : str
    count : int
    out : Path
        Gets `cases` for the tool and `labels` for the referee.
    geometries : sequence of str
    workers : int
        Processes.
    seed : str
    bodies : int, optional
        How many declared bodies the cases share, beside one for meshes that are too coarse; each has its own if None.

    Returns
    -------
    list of str
        Why a case was not made, for each of which no truth was found.
    """
    number = seed_of(f"{which} {seed}")
    plans = planned(which, count, geometries, number)
    shared: list[Setting | None] = [None] * count
    if bodies is not None:
        coarse = any(plan.names == ("coarse",) for plan in plans)
        drawn = draw_bodies(bodies, geometries, number, coarse)
        shared = [drawn[k] for k in assigned(plans, drawn, number)]
    names = [f"{which[:3]}-{k + 1:03d}" for k in range(count)]
    missing = [k for k, name in enumerate(names) if not (out / LABELS / f"{name}.json.gz").exists()]
    missing.sort(key=lambda k: -_work(plans[k]))
    not_made = []
    # a fresh process knows nothing of the threads of this one
    with ProcessPoolExecutor(max_workers=workers, mp_context=get_context("spawn"), initializer=single) as pool:
        jobs = [pool.submit(make_case, out, names[k], plans[k], [number, k], shared[k]) for k in missing]
        for ended, job in enumerate(as_completed(jobs), 1):
            try:
                outcome = job.result()
            except NoTruth as reason:
                # one case without a truth must not cost those that are still being made
                outcome = f"not made: {reason}"
                not_made.append(str(reason))
            print(f"{ended} of {len(missing)}: {outcome}", flush=True)
    write_commitments(out / LABELS)
    shutil.copy(out / LABELS / "commitments.txt", out / "commitments.txt")
    return not_made


def _work(plan: Planned) -> float:
    """About how long a case takes, in parts of one without effects: the longest are begun first."""
    if plan.kind in ("none", "trap"):
        return 1.0
    each = {"viscoelasticity": 6.0, "asymmetry": 6.0, "contact": 4.0, "inclusion": 4.0}
    return 1.0 + sum(each.get(name, 2.0) for name in plan.names)


def make_case(out: Path, name: str, plan: Planned, seed: Sequence[int], body: Setting | None = None) -> str:
    """Make one case, of what a body declares if there is one; a draw without a truth is counted, and drawn again.

    Returns
    -------
    str
        How it went, without what is true of it.
    """
    start_warp_quietly()
    started = time.perf_counter()
    given_up: list[str] = []
    for attempt in range(ATTEMPTS + IN_STEPS):
        try:
            truth = _draw(plan, [*seed, attempt], body)
            break
        except NoTruth as reason:
            given_up.append(str(reason))
    else:
        raise NoTruth(f"{name}: no truth in {len(given_up)} draws: {'; '.join(given_up)}")
    folder = out / CASES / name
    # half a folder of an interrupted making
    shutil.rmtree(folder, ignore_errors=True)
    folder.parent.mkdir(parents=True, exist_ok=True)
    write_folder(folder, name, truth)
    seal(out / LABELS, label_of(name, plan, truth, given_up))
    return f"{name} in {time.perf_counter() - started:.0f} s, {len(given_up)} draws given up"


def steps_of(attempt: int) -> int:
    """In how many steps the declared load of a draw is put on, of which so many were given up before."""
    return 1 if attempt < ATTEMPTS else _STEPS


def _draw(plan: Planned, seed: Sequence[int], body: Setting | None = None) -> Truth:
    random = np.random.default_rng(list(seed))
    setting = draw_setting(random, plan.geometry, timed="viscoelasticity" in plan.names)
    if body is not None:
        setting = on_body(setting, body)
    if plan.kind == "trap":
        setting = trapped(random, plan.names[0], setting)
    until = time.process_time() + LIMIT
    steps = steps_of(seed[-1])
    if plan.kind in ("none", "trap"):
        return solve_truth(setting, (), until, steps)
    # where a mechanism hardly shows in any body that was drawn, the largest sensible size of it must do
    least = LEAST if seed[-1] >= STRICT else BOTH if plan.kind == "two" else WANTED[0]
    wishes = [
        Wish(partial(draw_effect, random, name, setting), partial(wanted, random, least=least)) for name in plan.names
    ]
    return solve_truth(setting, wishes, until, steps)
