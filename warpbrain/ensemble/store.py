"""Outcomes in a folder, each written whole as soon as it is known: what a killed run has computed is never lost.

The folder holds `ensemble.json`, which says whose outcomes these are, and `samples/part-NNNN.npz`.
"""

from __future__ import annotations

import json
import shutil
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpbrain.atomic import output_folder, whole_file
from warpbrain.ensemble.job import Job
from warpbrain.ensemble.sample import Outcome
from warpbrain.errors import InputError

#: Names in the folder.
MANIFEST, PARTS = "ensemble.json", "samples"


def discard(folder: Path) -> None:
    """Take away the outcomes of an ensemble, if the folder holds some, so that all are computed anew."""
    if (folder / MANIFEST).is_file():
        shutil.rmtree(folder / PARTS, ignore_errors=True)
        (folder / MANIFEST).unlink()


class Store:
    """The outcomes of one ensemble.

    Parameters
    ----------
    folder : Path
        Made if it is not there.
    job : Job
        All of the ensemble, whose fingerprint tells it from others.
    kind : str
        Of the devices, see `warpbrain.ensemble.job.Job.fingerprint`.
    about : mapping
        What a reader of `ensemble.json` should know of it; plain values.

    Raises
    ------
    InputError
        If the folder holds another ensemble, or cannot be written to.
    """

    def __init__(self, folder: Path, job: Job, kind: str, about: Mapping[str, Any]) -> None:
        self.folder = folder
        # reactions are kept at nodes with constrained components only
        self._held = np.any(job.model.constrained, axis=1)
        fingerprint = job.fingerprint(kind)
        manifest = output_folder(folder) / MANIFEST
        self._parts = folder / PARTS
        if manifest.exists():
            _require_same(manifest, fingerprint)
        else:
            if self._parts.exists():
                raise InputError(f"{self._parts}: samples of an ensemble whose ensemble.json is missing: remove one")
            with whole_file(manifest) as scratch:
                known = {"fingerprint": fingerprint, **about, "devices": kind, "versions": job.versions}
                scratch.write_text(json.dumps(known, indent=2) + "\n", encoding="utf-8")
        output_folder(self._parts)
        last = self._files()[-1:]
        self._next = int(last[0].stem.removeprefix("part-")) + 1 if last else 0

    def _files(self) -> list[Path]:
        return sorted(self._parts.glob("part-*.npz"))

    def numbers(self) -> set[int]:
        """Samples whose outcome is here."""
        found: set[int] = set()
        for file in self._files():
            found |= set(_read(file)["number"].tolist())
        return found

    def write(self, outcomes: Sequence[Outcome]) -> None:
        """Write outcomes, all or none of them."""
        good = [outcome for outcome in outcomes if not outcome.failed]
        n, held = len(self._held), np.count_nonzero(self._held)
        arrays: dict[str, Any] = {
            **{name: np.array([getattr(o, name) for o in outcomes]) for name in _NUMBERS},
            "reason": np.array([outcome.reason for outcome in outcomes], dtype=np.str_),
            "u": np.array([outcome.u for outcome in good]).reshape(-1, n, 3),
            "reactions": np.array([outcome.reactions[self._held] for outcome in good]).reshape(-1, held, 3),
        }
        with whole_file(self._parts / f"part-{self._next:06d}.npz") as scratch, scratch.open("wb") as stream:
            np.savez(stream, **arrays)
        self._next += 1

    def outcomes(self) -> Iterator[Outcome]:
        """All outcomes, in the order in which they were written."""
        for file in self._files():
            arrays = _read(file)
            good = iter(range(len(arrays["u"])))
            for row, reason in enumerate(arrays["reason"].tolist()):
                u = reactions = np.zeros((0, 3))
                if not reason:
                    place = next(good)
                    u = arrays["u"][place]
                    reactions = np.zeros_like(u)
                    reactions[self._held] = arrays["reactions"][place]
                yield Outcome(
                    **{name: arrays[name][row].item() for name in _NUMBERS}, reason=reason, u=u, reactions=reactions
                )


_NUMBERS = ("number", "steps", "cg_iterations", "time", "residual", "min_J")


def _read(file: Path) -> dict[str, NDArray[Any]]:
    try:
        with np.load(file, allow_pickle=False) as arrays:
            return dict(arrays)
    except (OSError, EOFError, ValueError, KeyError, zipfile.BadZipFile) as error:
        raise InputError(
            f"{file}: not a file of samples: {error}; remove it, and its samples are computed again"
        ) from None


def _require_same(manifest: Path, fingerprint: str) -> None:
    try:
        found = json.loads(manifest.read_text(encoding="utf-8"))
        known = found["fingerprint"]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(f"{manifest}: not the manifest of an ensemble: {error}") from None
    if known != fingerprint:
        about = ", ".join(f"{key}: {value}" for key, value in found.items() if isinstance(value, str | int))
        about = about.removeprefix(f"fingerprint: {known}, ")
        raise InputError(
            f"{manifest.parent}: holds another ensemble ({about}): choose another folder, or --overwrite it"
        )
