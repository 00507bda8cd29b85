"""The table of a sweep: what is read is what was written, and a line that is damaged is not."""

import json

import numpy as np
import pytest

from warpbrain.errors import InputError
from warpbrain.estimation.sweep import SweepPoint
from warpbrain.report.sweep import estimated_in, read_sweep, write_sweep

HEADER = ["k grey", "k white", "mu grey", "mu white", "rms [m or N]", "no equilibrium; inputs abc", "checksum"]
POINTS = [
    SweepPoint((k, -k), (1000.0 + k, 1 / 3), None if k == 1.0 else 1e-3 * k, "tissue, torn" if k == 1.0 else "")
    for k in np.linspace(-2.0, 2.0, 9).tolist()
]


@pytest.fixture
def path(tmp_path):
    write_sweep(tmp_path / "sweep.csv", HEADER, POINTS)
    return tmp_path / "sweep.csv"


def test_what_is_read_is_what_was_written(path):
    assert read_sweep(path, HEADER, 2) == ({point.k: point for point in POINTS}, 0)
    assert read_sweep(path.parent / "none.csv", HEADER, 2) == ({}, 0)


def test_an_estimate_beside_a_sweep(tmp_path):
    path = tmp_path / "estimate.json"
    assert estimated_in(path) == {}
    one = {"tissue": "gel", "name": "shear modulus", "estimate": 900.0, "interval_95": [800.0, 1000.0]}
    path.write_text(json.dumps({"parameters": [one, {"tissue": "gel", "name": "exponent"}]}))
    assert estimated_in(path) == {"gel": (900.0, 800.0, 1000.0)}


@pytest.mark.parametrize(
    "content",
    [
        "", "{", "[]", "3", "{}", '{"parameters": 1}', '{"parameters": ["x"]}', '{"parameters": [{}]}',
        '{"parameters": [{"name": "shear modulus"}]}',
        *(
            f'{{"parameters": [{{"name": "shear modulus", "tissue": "gel", "estimate": 900, "interval_95": {ends}}}]}}'
            for ends in ("null", "[1, 2]", "[800]", '["a", "b"]', "[800, 1e999]", "[NaN, NaN]")
        ),
    ],
)  # fmt: skip
def test_a_damaged_estimate_beside_a_sweep(tmp_path, content):
    path = tmp_path / "estimate.json"
    path.write_text(content)
    with pytest.raises(InputError, match=r"estimate\.json: not an estimate to draw beside the sweep \(.*\)"):
        estimated_in(path)


def test_a_sweep_of_something_else(path):
    with pytest.raises(InputError, match=r"sweep\.csv: a sweep of something else"):
        read_sweep(path, [*HEADER[:-2], "no equilibrium; inputs abd", "checksum"], 2)


def test_damaged_lines(path):
    """Cut off, filled with zeros, or with one bit flipped anywhere."""
    rng = np.random.default_rng(0)
    known, content = {point.k: point for point in POINTS}, path.read_bytes()
    found = 0
    for number in range(300):
        damaged = bytearray(content)
        if number % 3 == 0:
            del damaged[rng.integers(len(content)) :]
        elif number % 3 == 1:
            at = int(rng.integers(len(content)))
            damaged[at : at + 40] = bytes(min(40, len(content) - at))
        else:
            damaged[rng.integers(len(content))] ^= 1 << int(rng.integers(8))
        path.write_bytes(damaged)
        points, lines = read_sweep(path, HEADER, 2)
        assert points.items() <= known.items()
        found += len(points) < len(known)
        assert len(points) == len(known) or lines or number % 3 == 0 or len(points) >= len(known) - 2
    assert found > 200


@pytest.mark.parametrize("content", [b"", bytes(500), b"k grey,k wh"])
def test_nothing_is_left_of_it(path, content):
    path.write_bytes(content)
    assert read_sweep(path, HEADER, 2) == ({}, 0)
