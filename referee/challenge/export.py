"""Writes cases in the neutral format: from their folders alone, which anybody may see."""

from __future__ import annotations

import shutil
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np

from referee.challenge.commands import LIST
from referee.challenge.neutral import NeutralCase, write_case
from referee.compliance.causes import candidates, seen, sites
from referee.compliance.neo_hookean import NeoHookeanBody
from referee.compliance.nuisances import noise_covariance, nuisances
from referee.compliance.response import DeclaredResponse
from referee.errors import InputError
from referee.threads import mapped
from warpbrain.cases.case import Case
from warpbrain.cases.reading import read_case


def export(cases: Path, out: Path, only: Sequence[str] = (), workers: int = 1) -> int:
    """Write `out/CASE.npz` and `out/CASE`, the case folder as it is, for each case, and the list of them.

    Parameters
    ----------
    cases : Path
        Folder of case folders.
    out : Path
    only : sequence of str, optional
        Names of the cases that are exported; all if there are none.
    workers : int
        Processes.

    Returns
    -------
    int
        How many.

    Raises
    ------
    InputError
        If there are no cases, or one of `only` is not there.
    """
    folders = {path.parent.name: path.parent for path in sorted(cases.glob("*/case.toml"))}
    if absent := sorted(set(only) - set(folders)):
        raise InputError(f"{cases}: has no case {', '.join(absent)}")
    names = sorted(only) or sorted(folders)
    if not names:
        raise InputError(f"{cases}: no folder in it has a case.toml")
    out.mkdir(parents=True, exist_ok=True)
    waiting = [folders[name] for name in names if not (out / f"{name}.npz").exists()]
    with mapped(workers) as each:
        for count, sentence in enumerate(each(partial(_export, out), waiting), start=1):
            print(f"{count} of {len(waiting)}: {sentence}", flush=True)
    (out / LIST).write_text("".join(f"{name}\n" for name in names), encoding="ascii")
    return len(names)


def _export(out: Path, folder: Path) -> str:
    """Write a case; the file appears when it is whole."""
    started = time.process_time()
    written = out / f".{folder.name}.npz"
    write_case(written, neutral_case(read_case(folder)))
    shutil.copytree(folder, out / folder.name, dirs_exist_ok=True)
    written.rename(out / f"{folder.name}.npz")
    return f"{folder.name} in {time.process_time() - started:.0f} s"


def neutral_case(case: Case) -> NeutralCase:
    """A case in the neutral format."""
    return neutral_of(DeclaredResponse(NeoHookeanBody(case)))


def neutral_of(response: DeclaredResponse) -> NeutralCase:
    """A case whose declared state was found in the neutral format."""
    rows = response.rows_of
    nuisance_name, nuisance_response = nuisances(response)
    names, numbers, places, lengths, amounts, units, columns = [], [], [], [], [], [], []
    for number, candidate in enumerate(candidates(response)):
        answer = seen(response, candidate)
        k = answer.shape[1]
        columns.append(answer)
        names += [candidate.cause] * k
        numbers += [number] * k
        places += [candidate.place] * k
        lengths += [candidate.length] * k
        amounts += [candidate.amount] * k
        units += [candidate.unit] * k
    site_place, site_response = sites(response)
    return NeutralCase(
        name=response.body.case.name,
        sensor_place=rows.place,
        sensor_direction=rows.direction,
        sensor_kind=rows.kind,
        sensor_point=rows.point,
        sensor_time=rows.time,
        recorded=rows.recorded,
        predicted=response.predicted,
        sigma_declared=rows.declares,
        noise_covariance=noise_covariance(rows),
        nuisance_name=np.array(nuisance_name),
        nuisance_response=nuisance_response,
        cause_name=np.array(names),
        cause_candidate=np.array(numbers),
        cause_place=np.array(places),
        cause_length=np.array(lengths),
        cause_amount=np.array(amounts),
        cause_unit=np.array(units),
        cause_response=np.concatenate(columns, axis=1),
        site_place=site_place,
        site_response=site_response,
    )
