"""Folders of sealed labels, and the published list of their hashes."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import Any

from concealed.sealing import fingerprint, open_sealed, read_sealed
from referee.errors import InputError

#: What a folder of labels has: sealed truths, and the list of their hashes, which is published.
COMMITMENTS = "commitments.txt"


def write_commitments(folder: Path) -> None:
    """List the hashes of all labels of a folder."""
    lines = [f"{fingerprint(read_sealed(file))}  {file.name[: -len('.json.gz')]}\n" for file in _files(folder)]
    (folder / COMMITMENTS).write_text("".join(lines), encoding="ascii")


def open_labels(folder: Path, commitments: Path, only: Collection[str] | None = None) -> dict[str, dict[str, Any]]:
    """Labels by name of case, each of which has the hash that was published.

    Parameters
    ----------
    folder : Path
        Of sealed labels.
    commitments : Path
        The list of hashes that was published.
    only : collection of str, optional
        Names of the cases that are opened; the others stay sealed.

    Raises
    ------
    InputError
        If a label is missing, was not committed to, or is not the one whose hash was published.
    """
    published = {}
    for line in commitments.read_text(encoding="ascii").splitlines():
        digest, name = line.split()
        if only is None or name in only:
            published[name] = digest
    if unknown := sorted(set(only or ()) - set(published)):
        raise InputError(f"{commitments}: has no hash of {', '.join(unknown)}")
    labels = {}
    for file in _files(folder):
        name = file.name[: -len(".json.gz")]
        if only is not None and name not in only:
            continue
        data = read_sealed(file)
        if name not in published:
            raise InputError(f"{file}: {commitments} has no hash of '{name}'")
        if fingerprint(data) != published[name]:
            raise InputError(f"{file}: its hash is {fingerprint(data)}, {commitments} says {published[name]}")
        labels[name] = open_sealed(data)
        if labels[name]["case"] != name:
            raise InputError(f"{file}: is the label of '{labels[name]['case']}'")
    missing = sorted(set(published) - set(labels))
    if missing:
        raise InputError(f"{folder}: no label of {', '.join(missing)}, whose hashes are in {commitments}")
    return labels


def _files(folder: Path) -> list[Path]:
    return sorted(folder.glob("*.json.gz"))
