"""What is written is what is read, digit for digit."""

from dataclasses import fields

import numpy as np
import pytest
from recording_files import messages, read

from warpbrain.errors import InputError
from warpbrain.frame import Frame
from warpbrain.recordings.recording import (
    ForceRecording,
    PointsRecording,
    Recording,
    SurfaceRecording,
    TestRecording,
)


def recordings(seed: int) -> list[Recording]:
    """Recordings of all kinds with numbers of all sizes."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 30))

    def numbers(*shape):
        return rng.choice([-1.0, 1.0], shape) * 10.0 ** rng.uniform(-9, 3, shape)

    time = np.cumsum(np.abs(numbers(n)))
    common = {"name": "r", "role": "fit", "sigma": None}
    normals = rng.normal(size=(n, 3))
    force = numbers(n, 3)
    force[:, rng.integers(3)] = np.nan
    marks = ["", ",", '"', "#", ";", " # ä"]
    return [
        PointsRecording(points=numbers(n, 3), displacement=numbers(n, 3), file="r.csv", **common),
        PointsRecording(
            points=numbers(n, 3),
            displacement=numbers(n, 3),
            time=time,
            ids=tuple(f"p{i}{marks[i % len(marks)]}" for i in range(n)),
            sigmas=np.abs(numbers(n)),
            weights=np.abs(numbers(n)),
            file="r.csv",
            **common,
        ),
        SurfaceRecording(
            points=numbers(n, 3),
            nodes="cavity",
            normals=normals / np.linalg.norm(normals, axis=1)[:, None],
            time=time,
            file="r.csv",
            **common,
        ),
        SurfaceRecording(
            points=rng.normal(size=(4, 3)),
            faces=np.array([[0, 1, 2], [1, 2, 3]], dtype=np.int32),
            nodes="cavity",
            file="r.vtu",
            **common,
        ),
        ForceRecording(boundary="grip", time=time, force=force, torque=numbers(n), file="r.csv", **common),
        TestRecording(
            mode="axial",
            quantities=("displacement", "force"),
            imposed=numbers(n),
            response=numbers(n),
            file="r.csv",
            **common,
        ),
        TestRecording(
            mode="axial",
            quantities=("stretch", "stress"),
            imposed=np.abs(numbers(n)),
            response=numbers(n),
            time=time,
            file="r.csv",
            **common,
        ),
    ]


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("frame", [Frame("m"), Frame("m", "LPS"), Frame("mm"), Frame("mm", "LPS")], ids=str)
def test_round_trip(tmp_path, frame, seed):
    for recording in recordings(seed):
        file = tmp_path / recording.file
        recording.write(file, frame)
        back, problems = read(recording.kind, file, frame)
        assert not problems, messages(problems)
        for field in fields(recording):
            written, found = getattr(recording, field.name), getattr(back, field.name)
            if isinstance(written, np.ndarray):
                # a thousandth has no exact double: in mm the last digit may differ; directions are normalised again
                exact = frame.unit == "m" and field.name != "normals"
                np.testing.assert_allclose(found, written, rtol=0 if exact else 5e-16, atol=0)
                assert found.dtype == written.dtype
            else:
                assert found == written


def test_what_cannot_be_written(tmp_path):
    points, _, surface, mesh, *_ = recordings(0)
    for recording, name in ((points, "a.vtu"), (surface, "a.vtu"), (mesh, "a.csv"), (points, "no/a.csv")):
        with pytest.raises(InputError):
            recording.write(tmp_path / name, Frame())
    named = PointsRecording(name="r", file="r", points=np.zeros((1, 3)), displacement=np.zeros((1, 3)), ids=("a\nb",))
    with pytest.raises(InputError, match="line break"):
        named.write(tmp_path / "a.csv", Frame())
    assert list(tmp_path.iterdir()) == []
