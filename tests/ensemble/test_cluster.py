"""A real Dask cluster of processes on loopback has the bits of the local run, also when a worker is killed midway."""

import logging
import os
import signal
import time
from collections.abc import Callable, Iterator
from dataclasses import replace

import dask
import deadly_parts
import distributed
import pytest
from command import warpbrain
from folders import write_folder
from many_samples import computed, samples_of, shaken_block
from material_point import LAWS

from warpbrain.ensemble.cluster import Cluster, local_workers
from warpbrain.ensemble.sample import Outcome
from warpbrain.ensemble.workers import Job
from warpbrain.errors import InputError, SolveError
from warpbrain.terminal.quiet import start_warp_quietly

WORKERS = 2
#: Enough moduli for parts to be many.
MODULI = tuple(500.0 + 150.0 * k for k in range(24))


def on_the_cluster(test: Callable[..., None]) -> Callable[..., None]:
    """Two processes, which take seconds to start and to end, serve all of these tests."""
    return pytest.mark.slow(3)(pytest.mark.xdist_group("cluster")(test))


def local_cluster(workers: int) -> distributed.LocalCluster:
    return distributed.LocalCluster(
        n_workers=workers, threads_per_worker=1, processes=True, dashboard_address=":0", silence_logs="CRITICAL"
    )


@pytest.fixture(scope="module")
def cluster() -> Iterator[distributed.LocalCluster]:
    # a machine that is busy takes longer to start a worker again than Dask waits for it by default
    with dask.config.set({"distributed.deploy.lost-worker-timeout": "10 minutes"}), local_cluster(WORKERS) as cluster:
        yield cluster


def job(steps: int) -> Job:
    model = shaken_block(LAWS["neo-hookean"])
    return Job(model, tuple(samples_of(model, MODULI)), steps=steps)


def bits(outcomes: dict[int, Outcome]) -> dict[int, tuple]:
    return {n: (o.u.tobytes(), o.reactions.tobytes(), o.steps, o.cg_iterations, o.reason) for n, o in outcomes.items()}


def alone(work: Job) -> dict[int, Outcome]:
    return computed(work.system("cpu"), work.course(), list(work.samples), 5)


@on_the_cluster
def test_a_cluster_has_the_bits_of_the_local_run(cluster):
    work = job(4)
    with Cluster(cluster.scheduler_address, 1, "cpu", None, start_warp_quietly) as workers:
        assert workers.kind == "cpu"
        assert workers.name == f"{WORKERS} workers of {cluster.scheduler_address}"
        parts = list(workers.outcomes(work))
    assert len(parts) >= 2 * WORKERS
    assert bits({o.number: o for part in parts for o in part}) == bits(alone(work))


@on_the_cluster
def test_a_killed_worker_costs_only_time(cluster):
    work = job(100)
    found: dict[int, Outcome] = {}
    killed: list[int] = []
    with Cluster(cluster.scheduler_address, 1, "cpu", None, start_warp_quietly) as workers:
        process = workers._client.run(os.getpid)
        for part in workers.outcomes(work):
            found.update({o.number: o for o in part})
            if not killed:
                busy = next(address for address, tasks in workers._client.processing().items() if tasks)
                killed.append(process[busy])
                os.kill(process[busy], signal.SIGKILL)
        # the cluster has grown a new worker, or is about to
        workers._client.wait_for_workers(WORKERS, timeout=300)
        assert killed[0] not in workers._client.run(os.getpid).values()
    assert bits(found) == bits(alone(work))


@pytest.mark.slow(10)
def test_what_workers_die_of_has_failed_and_the_rest_goes_on(monkeypatch):
    work = replace(job(2), samples=job(2).samples[:4])
    monkeypatch.setattr("warpbrain.ensemble.cluster.compute_part", deadly_parts.compute)
    monkeypatch.setattr("warpbrain.ensemble.cluster.parts_of", lambda job, *_: [job.part({0, 1}), job.part({2, 3})])
    # by default a worker that takes more than 15 s to start again is given up; here any that has to start again
    with (
        dask.config.set({"distributed.deploy.lost-worker-timeout": "1 ms"}),
        Cluster("local:1", 1, "cpu", None, start_warp_quietly) as workers,
    ):
        found = {outcome.number: outcome for part in workers.outcomes(work) for outcome in part}
    assert sorted(found) == [0, 1, 2, 3]
    assert [number for number, outcome in found.items() if outcome.failed] == [deadly_parts.DEADLY]
    assert found[deadly_parts.DEADLY].reason.startswith("2 workers died while they computed it, the last one tcp://")
    expected = bits(alone(work))
    assert {number: value == expected[number] for number, value in bits(found).items()} == {
        number: number != deadly_parts.DEADLY for number in range(4)
    }


@pytest.mark.slow(5)
@pytest.mark.parametrize("lost", ["worker", "scheduler"])
def test_what_does_not_come_back_ends_with_what_is_done_and_how_to_go_on(monkeypatch, lost):
    work = replace(job(2), samples=job(2).samples[:4])
    monkeypatch.setattr("warpbrain.ensemble.cluster.compute_part", deadly_parts.compute_without_end)
    monkeypatch.setattr("warpbrain.ensemble.cluster.parts_of", lambda job, *_: [job.part({k}) for k in (0, 2, 1, 3)])
    if lost == "worker":
        monkeypatch.setattr("warpbrain.ensemble.cluster._ABSENCE", 2.0)
    with local_cluster(1) as cluster, Cluster(cluster.scheduler_address, 1, "cpu", None, start_warp_quietly) as workers:
        outcomes = workers.outcomes(work)
        assert [outcome.number for outcome in next(outcomes)] == [0]
        # then the worker has the result of sample 2, computes 1 and has not begun 3
        while not any(future.status == "finished" for future in workers._pending):
            time.sleep(0.01)
        cluster.workers[0].close_gracefully()  # it does not start a worker again
        os.kill(cluster.workers[0].pid, signal.SIGKILL)
        if lost == "scheduler":
            cluster.close()
        why = {"worker": "there was no worker for 2 s", "scheduler": "Client lost the connection to the scheduler.*"}
        told = rf"samples came back, sample [123] did not: {why[lost]}\. The same command goes on with what is missing"
        with pytest.raises(SolveError, match=rf"--dask {cluster.scheduler_address}: 1 of 4 {told}"):
            next(outcomes)


@pytest.mark.slow(5)
def test_workers_that_die_before_any_part():
    with pytest.raises(InputError, match="--dask local:1: workers die of being asked what device they have"):
        Cluster("local:1", 1, "cpu", None, deadly_parts.die)


@pytest.mark.slow(8)
def test_local_starts_its_own_cluster(tmp_path):
    grey, white = (f'prior = "hyperelastic/{anatomy} matter"' for anatomy in ("grey", "white"))
    priors = ("mu = 1000.0", f"mu = 1000.0\n{grey}"), ("mu = 3000.0", f"mu = 3000.0\n{white}")
    case = write_folder(tmp_path / "case", *priors)
    arguments = ["ensemble", "--case", case, "--samples", "4", "--steps", "2", "--device", "cpu"]
    one = warpbrain(*arguments, "--processes", "1", "--out", tmp_path / "one")
    many = warpbrain(*arguments, "--dask", "local:2", "--out", tmp_path / "many")
    assert (one.status, many.status) == (0, 0), one.err + many.err
    assert "2 workers of tcp://127.0.0.1:" in many.out
    assert (tmp_path / "one" / "samples.csv").read_bytes() == (tmp_path / "many" / "samples.csv").read_bytes()


@on_the_cluster
def test_a_worker_of_another_version_is_refused(cluster):
    work = job(1)
    other = Job(work.model, work.samples, steps=1, versions={**work.versions, "warp-lang": "0.0"})
    with (
        Cluster(cluster.scheduler_address, 1, "cpu", None, start_warp_quietly) as workers,
        pytest.raises(InputError, match="a worker has"),
    ):
        list(workers.outcomes(other))


@on_the_cluster
def test_a_device_that_no_worker_has(cluster):
    with pytest.raises(InputError, match="device 'cuda:7': not found on this machine"):
        Cluster(cluster.scheduler_address, 1, "cuda:7", None, start_warp_quietly)


def test_no_scheduler(monkeypatch):
    # of its attempts, which a process that goes on would otherwise hear of later
    logging.getLogger("distributed.utils").setLevel(logging.CRITICAL)
    monkeypatch.setattr("warpbrain.ensemble.cluster._PATIENCE", 1)
    with pytest.raises(InputError, match=r"--dask tcp://127\.0\.0\.1:9: no scheduler with a worker answers"):
        Cluster("tcp://127.0.0.1:9", 1, "cpu", None, start_warp_quietly)


def test_an_encrypted_scheduler_without_certificates():
    with pytest.raises(
        InputError, match=r"--dask tls://127\.0\.0\.1:9: needs certificates: set DASK_DISTRIBUTED__COMM__TLS"
    ):
        Cluster("tls://127.0.0.1:9", 1, "cpu", None, start_warp_quietly)


def test_addresses():
    assert (local_workers("local"), local_workers("local:3"), local_workers("tcp://host:8786")) == (0, 3, None)
    for wrong in ("local:", "local:x", "local:-1", "host:8786", ""):
        with pytest.raises(InputError, match="--dask"):
            local_workers(wrong)
