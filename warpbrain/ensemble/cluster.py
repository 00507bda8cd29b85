"""Workers of a Dask cluster, one a device. Dask is imported here and nowhere else.

Each part carries everything it needs and its outcomes come back to the client, which writes them: workers share no file
system with it. A worker that dies costs the time of its part, which the scheduler gives to another. Where others die of
it too, each of its samples is computed by itself, and those of which workers die have failed; the rest go on. Where all
workers are gone and none comes back in a stated time, what came back is kept and the rest ends with an error.
"""

import logging
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from importlib.util import find_spec
from typing import Any

from warpbrain.ensemble.sample import Outcome, failure
from warpbrain.ensemble.workers import ENOUGH, Job, Prepare, compute_part, kind_of, parts_of
from warpbrain.errors import InputError, SolveError

#: Seconds to wait for a scheduler to answer, and for its first worker.
_PATIENCE = 30
#: Workers of this machine that may die of a part until nobody takes it; other schedulers have their own count.
_DEATHS = 2
#: Seconds without any worker until nobody waits for one: a scheduler gives a silent worker as many.
_ABSENCE = 300.0


def local_workers(address: str) -> int | None:
    """Workers that ``local[:N]`` asks for, 0 if it does not say how many; None if it is the address of a scheduler."""
    if address == "local":
        return 0
    if address.startswith("local:"):
        count = address.removeprefix("local:")
        if not count.isdecimal() or int(count) < 1:
            raise InputError(f"--dask {address}: expected a whole number of workers of at least 1 after 'local:'")
        return int(count)
    if "://" not in address:
        raise InputError(f"--dask {address}: expected the address of a scheduler, as tcp://host:8786, or local[:N]")
    return None


class Cluster(AbstractContextManager["Cluster"]):
    """A Dask cluster, or one of processes of this machine that lives as long as this object's context.

    The address is of a scheduler; ``local:N`` starts processes here, ``local`` so many `workers`. Each has a Warp
    device and takes a batch of samples at a time, None for what it has memory for and pays; it is prepared before each
    part. `InputError` if Dask is not installed, no scheduler or worker answers, or workers die before any part.
    """

    def __init__(self, address: str, workers: int, device: str | None, batch: int | None, prepare: Prepare) -> None:
        count = local_workers(address)
        if find_spec("distributed") is None:
            raise InputError('--dask: needs the dask extra: pip install "warpbrain[dask]"')
        import distributed

        # what it logs of workers that come and go is no news to a user; errors come as exceptions
        for name in ("distributed", "distributed.client"):
            logging.getLogger(name).setLevel(logging.CRITICAL)
        self._address, self._device, self._batch, self._prepare = address, device, batch, prepare
        self._pending: set[Any] = set()
        with ExitStack() as stack:
            try:
                self._client = _connect(stack, address, workers if count == 0 else count)
                self._client.wait_for_workers(1, timeout=_PATIENCE)
            except OSError as error:
                raise InputError(f"--dask {address}: no scheduler with a worker answers: {error}") from None
            except TypeError:
                if not address.startswith("tls://"):
                    raise
                variable = "DASK_DISTRIBUTED__COMM__TLS__CA_FILE"
                raise InputError(
                    f"--dask {address}: needs certificates: set {variable}, ... (docs/ensembles.md)"
                ) from None
            stack.enter_context(self._watched())
            try:
                self.kind = str(self._result(self._submit(_kind, device, prepare), "no worker said what device it has"))
            except distributed.KilledWorker:
                raise InputError(f"--dask {address}: workers die of being asked what device they have") from None
            self._count = len(self._client.scheduler_info(n_workers=-1)["workers"])
            self.name = f"{self._count} workers of {self._client.scheduler.address}"
            # nothing went wrong: it is closed by this object's own context
            self._stack = stack.pop_all()

    def __exit__(self, *_error: object) -> None:
        self._stack.close()

    def outcomes(self, job: Job) -> Iterator[list[Outcome]]:
        """See `Workers`; `InputError` if a worker has other versions than this machine, or no such device.

        `SolveError` if there is no worker for `_ABSENCE` seconds, or no scheduler any more.
        """
        import distributed

        pending: dict[Any, Job] = {}
        # samples that workers died of: one that only waited at such a worker counts as one of them, so each is computed
        # again with nothing beside it before it is blamed
        suspects: list[int] = []
        alone = False
        done = 0

        def submit(part: Job) -> Any:
            future = self._submit(compute_part, part, self._device, self._batch, self._prepare)
            pending[future] = part
            return future

        parts = parts_of(job, self._count, self._batch or ENOUGH[self.kind])
        ending = distributed.as_completed([submit(part) for part in parts])
        for future in ending:
            numbers = [sample.number for sample in pending.pop(future).samples]
            which = f"sample {numbers[0]}" + (f" and {len(numbers) - 1} more" if len(numbers) > 1 else "")
            doing = f"{done} of {len(job.samples)} samples came back, {which} did not"
            try:
                outcomes = self._result(future, doing)
            except distributed.KilledWorker as error:
                outcomes = []
                if len(numbers) > 1:
                    ending.update([submit(job.part({number})) for number in numbers])
                elif not alone:
                    suspects += numbers
                else:
                    count, last = error.allowed_failures + 1, error.last_worker.address
                    reason = f"{count} workers died while they computed it, the last one {last}"
                    outcomes = [failure(numbers[0], f"{reason}: out of memory? Their logs say more")]
            if outcomes:
                done += len(outcomes)
                yield outcomes
            if not pending and suspects:
                alone = True
                ending.add(submit(job.part({suspects.pop(0)})))

    def _submit(self, function: Callable[..., Any], *arguments: Any) -> Any:
        future = self._client.submit(function, *arguments, pure=False)
        self._pending.add(future)
        return future

    def _result(self, future: Any, doing: str) -> Any:
        """What a worker made, which the scheduler may forget; `SolveError` with what was done if it was cancelled."""
        import distributed

        try:
            return future.result()
        except distributed.CancelledError as error:
            why = (error.msg or error.reason).rstrip(".")
            raise SolveError(
                f"--dask {self._address}: {doing}: {why}. The same command goes on with what is missing"
            ) from None
        finally:
            self._pending.discard(future)
            future.release()

    @contextmanager
    def _watched(self) -> Iterator[None]:
        """Meanwhile, cancel what is pending once there has been no worker for `_ABSENCE` seconds.

        A future has no such limit of its own: neither one that waits for a worker, nor one whose result was lost with
        the worker that had it.
        """
        ended = threading.Event()

        def watch() -> None:
            seen = time.monotonic()
            # a client that finds its scheduler no more has cancelled everything and closes itself
            while not ended.wait(_ABSENCE / 20) and self._client.status != "closed":
                try:
                    there = bool(self._client.nthreads())
                except OSError:
                    there = False
                if there:
                    seen = time.monotonic()
                elif time.monotonic() - seen >= _ABSENCE:
                    self._client.cancel(list(self._pending), msg=f"there was no worker for {_ABSENCE:.0f} s")

        thread = threading.Thread(target=watch, daemon=True)
        thread.start()
        try:
            yield
        finally:
            ended.set()
            thread.join()


def _connect(stack: ExitStack, address: str, workers: int | None) -> Any:
    """A client of a scheduler, or of a new cluster of so many processes of this machine."""
    import dask
    import distributed

    if workers is None:
        return stack.enter_context(distributed.Client(address, timeout=_PATIENCE))
    # Dask gives up a worker that takes longer than 15 s to come back, as one does on a machine that is busy
    stack.enter_context(dask.config.set({"distributed.deploy.lost-worker-timeout": f"{_ABSENCE} s"}))
    with dask.config.set({"distributed.scheduler.allowed-failures": _DEATHS - 1}):
        cluster = distributed.LocalCluster(
            n_workers=workers, threads_per_worker=1, processes=True, dashboard_address=":0", silence_logs="CRITICAL"
        )
    return stack.enter_context(distributed.Client(stack.enter_context(cluster)))


def _kind(device: str | None, prepare: Prepare) -> str:
    prepare()
    return kind_of(device)
