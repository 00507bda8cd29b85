"""Files beside cases, damaged at random: images, points to move, saved states; each is read or refused in one line."""

import gzip

import numpy as np
import pytest
from folders import block
from landmark_files import START, fcsv, markup

from damage.kinds import KINDS
from warpbrain.errors import InputError
from warpbrain.images.grid import Grid
from warpbrain.images.moving_points import read_point_file
from warpbrain.images.reading import read_image
from warpbrain.images.writing import write_volume
from warpbrain.mesh import write_mesh
from warpbrain.report.files import read_state

TRIES = 120


def damage(path, read, content, seed, pack=bytes):
    """Damage a file many times; returns how often it was refused, in one line that names it."""
    messages = []
    for number in range(TRIES):
        rng = np.random.default_rng([seed, number])
        path.write_bytes(pack(KINDS[rng.integers(len(KINDS))](content, rng)))
        try:
            read(path)
        except InputError as error:
            messages.append(str(error))
    assert [message for message in messages if "\n" in message or path.name not in message] == []
    return len(messages)


@pytest.mark.parametrize("packed", [False, True])
def test_images(tmp_path, packed):
    pytest.importorskip("nibabel")
    values = np.arange(60, dtype=np.int16).reshape(3, 4, 5)
    write_volume(tmp_path / "a.nii.gz", values, Grid((3, 4, 5), np.eye(4)))
    content = (tmp_path / "a.nii.gz").read_bytes()
    if packed:
        assert damage(tmp_path / "b.nii.gz", read_image, content, 1) > TRIES / 2
    else:
        # inside of what is compressed: the header and the numbers
        assert damage(tmp_path / "b.nii.gz", read_image, gzip.decompress(content), 2, gzip.compress) > TRIES / 3


@pytest.mark.parametrize("name", ["F.mrk.json", "F.fcsv", "sub-1_electrodes.tsv"])
def test_points_to_move(tmp_path, name):
    content = {
        "F.mrk.json": markup(*START),
        "F.fcsv": fcsv(*START),
        "sub-1_electrodes.tsv": "name\tx\ty\tz\nA\t1\t2\t3\nB\t4\t5\t6\n",
    }[name]
    (tmp_path / "sub-1_coordsystem.json").write_text(
        '{"iEEGCoordinateSystem": "Pixels", "iEEGCoordinateUnits": "mm"}'.replace("Pixels", "ScanRAS")
    )
    assert damage(tmp_path / name, read_point_file, content.encode(), 3) > TRIES / 3


def test_states(tmp_path, capsys):
    write_mesh(tmp_path / "result.vtu", block(), unit="mm")
    content = (tmp_path / "result.vtu").read_bytes()
    # there is no displacement in it: none is read
    assert damage(tmp_path / "result.vtu", read_state, content, 4) == TRIES
    # meshio prints where it gives up
    assert capsys.readouterr() == ("", "")
