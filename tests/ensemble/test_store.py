"""Outcomes in a folder: what is read is what was written, and a folder is of one ensemble."""

import json
from dataclasses import replace

import numpy as np
import pytest
from many_samples import computed, samples_of, shaken_block
from material_point import LAWS

from warpbrain.ensemble.sample import Sample, failure
from warpbrain.ensemble.store import Store
from warpbrain.ensemble.workers import Job
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


def written(job, outcomes, folder) -> Store:
    """Three samples in two parts."""
    store = Store(folder, job, "cpu", {"case": "block"})
    store.write([outcomes[0], outcomes[5]])
    store.write([outcomes[2]])
    return store


def bits(store: Store) -> dict[int, bytes]:
    return {outcome.number: outcome.u.tobytes() for outcome in store.outcomes()}


@pytest.mark.parametrize("content", ["", "[]", "{}", "\x00", '{"fingerprint": 1, "sha256": "x"}'])
def test_a_damaged_manifest(job, outcomes, tmp_path, content):
    """Parts say by themselves whose they are: what they hold is used, and the manifest is written anew."""
    before = bits(written(job, outcomes, tmp_path))
    whole = (tmp_path / "ensemble.json").read_bytes()
    (tmp_path / "ensemble.json").write_text(content)
    again = Store(tmp_path, job, "cpu", {"case": "block"})
    assert again.damaged == ["ensemble.json"]
    assert bits(again) == before
    assert (tmp_path / "ensemble.json").read_bytes() == whole


@pytest.mark.parametrize("manifest", ["", None])
def test_a_damaged_manifest_of_another_ensemble(job, outcomes, tmp_path, manifest):
    written(job, outcomes, tmp_path)
    (tmp_path / "ensemble.json").unlink()
    if manifest is not None:
        (tmp_path / "ensemble.json").write_text(manifest)
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    with pytest.raises(InputError, match=r"part-000000\.npz: samples of another ensemble"):
        Store(tmp_path, replace(job, steps=4), "cpu", {})
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before


def test_samples_without_a_manifest(job, outcomes, tmp_path):
    before = bits(written(job, outcomes, tmp_path))
    (tmp_path / "ensemble.json").unlink()
    again = Store(tmp_path, job, "cpu", {"case": "block"})
    assert bits(again) == before
    assert (tmp_path / "ensemble.json").exists()


def test_a_part_of_another_ensemble(job, outcomes, tmp_path):
    """Put there by hand: it is sound, and not of this one."""
    written(job, outcomes, tmp_path / "a")
    Store(tmp_path / "b", replace(job, steps=4), "cpu", {})
    (tmp_path / "a" / "samples" / "part-000001.npz").rename(tmp_path / "b" / "samples" / "part-000000.npz")
    with pytest.raises(InputError, match=r"part-000000\.npz: samples of another ensemble"):
        Store(tmp_path / "b", replace(job, steps=4), "cpu", {})


def test_a_folder_of_before_there_were_checksums(job, outcomes, tmp_path):
    """Of this ensemble all is computed again; of another one nothing is touched."""
    written(job, outcomes, tmp_path)
    manifest = tmp_path / "ensemble.json"
    said = json.loads(manifest.read_text())
    del said["sha256"]
    manifest.write_text(json.dumps(said))
    part = tmp_path / "samples" / "part-000000.npz"
    with np.load(part) as arrays:
        np.savez(part, **{name: values for name, values in arrays.items() if name != "sha256"})
    with pytest.raises(InputError, match="holds another ensemble"):
        Store(tmp_path, replace(job, steps=4), "cpu", {})
    again = Store(tmp_path, job, "cpu", {"case": "block"})
    assert again.damaged == ["ensemble.json", "samples/part-000000.npz"]
    assert again.numbers() == {2}


def test_a_damaged_part(job, outcomes, tmp_path):
    """Cut off, filled with zeros or with one bit flipped anywhere: what is used is sound, to the last bit."""
    rng = np.random.default_rng(0)
    whole = bits(written(job, outcomes, tmp_path))
    part = tmp_path / "samples" / "part-000000.npz"
    content = part.read_bytes()
    found = 0
    for number in range(60):
        damaged = bytearray(content)
        if number % 3 == 0:
            del damaged[rng.integers(len(content)) :]
        elif number % 3 == 1:
            at, to = sorted(rng.integers(0, len(content) + 1, 2))
            damaged[at:to] = bytes(to - at)
        else:
            damaged[rng.integers(len(content))] ^= 1 << int(rng.integers(8))
        part.write_bytes(damaged)
        again = Store(tmp_path, job, "cpu", {"case": "block"})
        # some bits mean nothing, as those of the time of a member of the archive
        if again.damaged:
            found += 1
            assert again.damaged == ["samples/part-000000.npz"] and not part.exists()
            assert again.numbers() == {2}
        assert bits(again) == {number: whole[number] for number in again.numbers()}
    assert found > 40


def test_a_part_that_is_damaged_while_it_is_used(job, outcomes, tmp_path):
    store = written(job, outcomes, tmp_path)
    (tmp_path / "samples" / "part-000000.npz").write_bytes(b"no archive")
    with pytest.raises(InputError, match=r"part-000000\.npz: cannot be read: .*; the same command computes"):
        list(store.outcomes())


def test_what_a_killed_process_left_half_written_goes(job, outcomes, tmp_path):
    written(job, outcomes, tmp_path)
    (tmp_path / "samples" / ".unfinished-part-000002-abc.npz").write_bytes(b"half")
    assert Store(tmp_path, job, "cpu", {}).numbers() == {0, 2, 5}
    assert sorted(path.name for path in (tmp_path / "samples").iterdir()) == ["part-000000.npz", "part-000001.npz"]


def test_a_manifest_says_whose_it_is(job, tmp_path):
    Store(tmp_path, job, "cpu", {"case": "block"})
    said = json.loads((tmp_path / "ensemble.json").read_text())
    assert len(said.pop("sha256")) == 64
    assert said == {
        "fingerprint": job.fingerprint("cpu"), "case": "block", "devices": "cpu", "versions": job.versions
    }  # fmt: skip
