"""Outcomes in a folder: what is read is what was written, and a folder is of one ensemble."""

import json
from dataclasses import replace

import numpy as np
import pytest
from many_samples import computed, samples_of, shaken_block
from material_point import LAWS

from warpbrain.ensemble.job import Job
from warpbrain.ensemble.sample import Sample, failure
from warpbrain.ensemble.store import Store
from warpbrain.errors import InputError
from warpbrain.physics.laws import NeoHookean


@pytest.fixture(scope="module")
def job() -> Job:
    model = shaken_block(LAWS["neo-hookean"])
    return Job(model, (*samples_of(model), Sample(7, None, "unstable")), steps=3)


@pytest.fixture(scope="module")
def outcomes(job):
    return computed(job.system("cpu"), job.course(), list(job.samples), 4)


def test_what_is_read_is_what_was_written(job, outcomes, tmp_path):
    store = Store(tmp_path / "out", job, "cpu", {"case": "block"})
    assert store.numbers() == set()
    store.write([outcomes[2], outcomes[7]])
    store.write([outcomes[0], outcomes[5]])
    again = Store(tmp_path / "out", job, "cpu", {"case": "block"})
    assert again.numbers() == {0, 2, 5, 7}
    again.write([outcomes[3]])
    found = {outcome.number: outcome for outcome in again.outcomes()}
    assert sorted(found) == [0, 2, 3, 5, 7]
    for number, outcome in found.items():
        expected = outcomes[number]
        assert outcome.u.tobytes() == expected.u.tobytes()
        assert outcome.reactions.tobytes() == expected.reactions.tobytes()
        plain = {name: getattr(outcome, name) for name in ("reason", "steps", "cg_iterations", "time")}
        assert plain == {name: getattr(expected, name) for name in plain}
        np.testing.assert_array_equal([outcome.residual, outcome.min_J], [expected.residual, expected.min_J])
    assert found[7].reason == "unstable" and found[7].u.shape == (0, 3)
    # nothing half-written, and no other file
    assert sorted(path.name for path in (tmp_path / "out" / "samples").iterdir()) == [
        f"part-{k:06d}.npz" for k in range(3)
    ]


def test_a_folder_of_failures_only(job, tmp_path):
    store = Store(tmp_path / "out", job, "cpu", {})
    store.write([failure(1, "lost"), failure(0, "lost too")])
    assert [(o.number, o.reason) for o in store.outcomes()] == [(1, "lost"), (0, "lost too")]


def changes(job: Job) -> dict[str, Job]:
    model = job.model
    stiff = samples_of(model, (600.0001,))
    heavier = [replace(load, density=1041.0) for load in model.loads]
    return {
        "samples": replace(job, samples=job.samples[:-1]),
        "materials": replace(job, samples=(*stiff, *job.samples[1:])),
        "steps": replace(job, steps=4),
        "to rest": replace(job, steps=None),
        "precision": replace(job, precision="single"),
        "versions": replace(job, versions={**job.versions, "warp-lang": "0"}),
        "density": replace(job, model=replace(model, density=1000.0)),
        "loads": replace(job, model=replace(model, loads=heavier)),
        "motions": replace(job, model=replace(model, motions=())),
        "prescribed": replace(job, model=replace(model, prescribed=2.0 * model.prescribed)),
    }


def test_a_folder_is_of_one_ensemble(job, tmp_path):
    Store(tmp_path / "out", job, "cpu", {"case": "block", "course": "3 steps"})
    for name, other in changes(job).items():
        with pytest.raises(InputError, match=r"out: holds another ensemble \(case: block, course: 3 steps"):
            Store(tmp_path / "out", other, "cpu", {"case": "block"})
        assert other.fingerprint("cpu") != job.fingerprint("cpu"), name
    with pytest.raises(InputError, match="devices: cpu"):
        Store(tmp_path / "out", job, "cuda", {})


def test_the_model_s_own_materials_decide_nothing(job):
    other = {label: replace(m, law=NeoHookean(1.0)) for label, m in job.model.materials.items()}
    assert replace(job, model=replace(job.model, materials=other)).fingerprint("cpu") == job.fingerprint("cpu")


@pytest.mark.parametrize("content", ["", "[]", "{}", "\x00"])
def test_a_broken_manifest(job, tmp_path, content):
    (tmp_path / "ensemble.json").write_text(content)
    with pytest.raises(InputError, match=r"ensemble\.json: not the manifest of an ensemble"):
        Store(tmp_path, job, "cpu", {})


def test_samples_without_a_manifest(job, tmp_path):
    (tmp_path / "samples").mkdir()
    with pytest.raises(InputError, match=r"samples: samples of an ensemble whose ensemble\.json is missing"):
        Store(tmp_path, job, "cpu", {})


def test_a_damaged_part(job, outcomes, tmp_path):
    store = Store(tmp_path, job, "cpu", {})
    store.write([outcomes[0]])
    part = tmp_path / "samples" / "part-000000.npz"
    whole = part.read_bytes()
    for damaged in (b"", b"no archive", whole[: len(whole) // 2]):
        part.write_bytes(damaged)
        with pytest.raises(InputError, match=r"part-000000\.npz: not a file of samples"):
            store.numbers()


def test_a_manifest_says_whose_it_is(job, tmp_path):
    Store(tmp_path, job, "cpu", {"case": "block"})
    said = json.loads((tmp_path / "ensemble.json").read_text())
    assert said == {
        "fingerprint": job.fingerprint("cpu"), "case": "block", "devices": "cpu", "versions": job.versions
    }  # fmt: skip
