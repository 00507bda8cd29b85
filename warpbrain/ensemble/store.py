"""Outcomes in a folder, each written whole as soon as it is known: what a killed run has computed is never lost.

The folder holds `ensemble.json`, which says whose outcomes these are, and `samples/part-NNNNNN.npz`. Every file holds a
checksum of all that it says. A part that is damaged is taken away, so that its samples are computed again; a damaged
`ensemble.json` is written anew where no sound part is of another ensemble.
"""

import hashlib
import json
import shutil
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpbrain.atomic import output_folder, remove_leftovers, whole_file
from warpbrain.ensemble.sample import Outcome
from warpbrain.ensemble.workers import Job
from warpbrain.errors import InputError

#: Names in the folder.
MANIFEST, PARTS = "ensemble.json", "samples"


def discard(folder: Path) -> None:
    """Take away the outcomes of an ensemble, if the folder holds some, so that all are computed anew."""
    if (folder / MANIFEST).is_file():
        shutil.rmtree(folder / PARTS, ignore_errors=True)
        (folder / MANIFEST).unlink()


class Store:
    """The outcomes of one ensemble in a folder, which is made if it is not there.

    The fingerprint of the whole job on a kind of devices tells it from others; `about` are plain values that a reader
    of `ensemble.json` should know. Of files that were `damaged` nothing is used. `InputError` if the folder holds
    another ensemble, or cannot be written to.
    """

    def __init__(self, folder: Path, job: Job, kind: str, about: Mapping[str, Any]) -> None:
        self.folder = folder
        # reactions are kept at nodes with constrained components only
        self._held, self._nodes = np.flatnonzero(np.any(job.model.constrained, axis=1)), len(job.model.constrained)
        self._fingerprint = job.fingerprint(kind)
        manifest = output_folder(folder) / MANIFEST
        self._parts = folder / PARTS
        known = {"fingerprint": self._fingerprint, **about, "devices": kind, "versions": job.versions}
        damaged = manifest.exists() and self._is_damaged(manifest)
        self._numbers: set[int] = set()
        unsound = [file for file in self._files() if not self._is_sound(file)]
        if damaged or not manifest.exists():
            # only now is it known that no part is of another ensemble
            with whole_file(manifest) as scratch:
                text = json.dumps({**known, "sha256": checksum_of(known)}, indent=2)
                scratch.write_text(text + "\n", encoding="utf-8")
        for file in unsound:
            file.unlink(missing_ok=True)
        remove_leftovers(output_folder(self._parts))
        self.damaged = ([MANIFEST] if damaged else []) + [f"{PARTS}/{file.name}" for file in unsound]
        last = self._files()[-1:]
        self._next = int(last[0].stem.removeprefix("part-")) + 1 if last else 0

    def _files(self) -> list[Path]:
        return sorted(self._parts.glob("part-*.npz"))

    def _is_damaged(self, manifest: Path) -> bool:
        """Whether its checksum is another one; `InputError` if it is of another ensemble."""
        try:
            content = json.loads(manifest.read_text(encoding="utf-8"))
            checksum, known = content.pop("sha256", None), content["fingerprint"]
        except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
            return True
        # one without a checksum is as old as that and may be of another ensemble, too
        if checksum not in (checksum_of(content), None):
            return True
        if known != self._fingerprint:
            about = ", ".join(
                f"{key}: {value}"
                for key, value in content.items()
                if isinstance(value, str | int) and key != "fingerprint"
            )
            raise InputError(
                f"{self.folder}: holds another ensemble ({about}): choose another folder, or --overwrite it"
            )
        return checksum is None

    def _is_sound(self, part: Path) -> bool:
        """Whether a part is what was written; `InputError` if it is of another ensemble."""
        try:
            arrays = read_arrays(part)
        except ValueError:
            return False
        if str(arrays["fingerprint"]) != self._fingerprint:
            raise InputError(f"{part}: samples of another ensemble: choose another folder, or --overwrite it")
        self._numbers |= set(arrays["number"].tolist())
        return True

    def numbers(self) -> set[int]:
        return set(self._numbers)

    def write(self, outcomes: Sequence[Outcome]) -> None:
        """Write outcomes, all or none of them."""
        good = [outcome for outcome in outcomes if not outcome.failed]
        arrays: dict[str, Any] = {
            "fingerprint": np.array(self._fingerprint),
            **{name: np.array([getattr(o, name) for o in outcomes]) for name in _NUMBERS},
            "reason": np.array([outcome.reason for outcome in outcomes], dtype=np.str_),
            "u": np.array([outcome.u for outcome in good]).reshape(-1, self._nodes, 3),
            "reactions": np.array([outcome.support for outcome in good]).reshape(-1, len(self._held), 3),
        }
        with whole_file(self._parts / f"part-{self._next:06d}.npz") as scratch, scratch.open("wb") as stream:
            np.savez(stream, **(arrays | {_NAME: np.array(_digest(arrays))}))
        self._next += 1
        self._numbers |= {outcome.number for outcome in outcomes}

    def outcomes(self) -> Iterator[Outcome]:
        """All outcomes, in the order in which they were written."""
        for file in self._files():
            try:
                arrays = read_arrays(file)
            except ValueError as error:
                # since the folder was opened
                raise InputError(f"{file}: {error}; the same command computes its samples again") from None
            good = iter(range(len(arrays["u"])))
            for row, reason in enumerate(arrays["reason"].tolist()):
                numbers = {name: arrays[name][row].item() for name in _NUMBERS}
                place = None if reason else next(good)
                u, support = (np.zeros((0, 3)) if place is None else arrays[name][place] for name in ("u", "reactions"))
                held = self._held[: len(support)]
                yield Outcome(**numbers, reason=reason, u=u, held=held, support=support)


_NUMBERS = ("number", "steps", "cg_iterations", "time", "residual", "min_J")


#: Name of the checksum among the arrays of a file: what a disk or a transfer damaged is never read as numbers. A ZIP
#: archive has a CRC-32 of each member, and none of its directory, of names, or of what was swapped for another file.
_NAME = "sha256"


def read_arrays(path: Path) -> dict[str, NDArray[Any]]:
    """Arrays of a file with their checksum; `ValueError` if anything of it has changed, or it is no such file."""
    try:
        with np.load(path, allow_pickle=False) as stored:
            arrays = dict(stored)
        checksum = str(arrays.pop(_NAME))
    # what NumPy and zipfile raise for bytes that are nonsense is their secret
    except Exception as error:
        raise ValueError(f"cannot be read: {' '.join(str(error).split())[:200]}") from None
    if checksum != _digest(arrays):
        raise ValueError("its checksum is another one")
    return arrays


def checksum_of(values: Any) -> str:
    """SHA-256 of plain values, whatever the order of their keys."""
    return hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()


def _digest(arrays: Mapping[str, NDArray[Any]]) -> str:
    digest = hashlib.sha256()
    for name in sorted(arrays):
        array = np.asarray(arrays[name])
        digest.update(f"{name} {array.dtype.str} {array.shape};".encode())
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()
