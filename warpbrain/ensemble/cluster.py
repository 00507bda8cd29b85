"""Workers of a Dask cluster, one a device. Dask is imported here and nowhere else.

Each part carries everything it needs and its outcomes come back to the client, which writes them: workers share no file
system with it. A worker that dies costs the time of its part, which the scheduler gives to another. Where others die of
it too, each of its samples is computed by itself, and those of which workers die have failed; the rest go on.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import AbstractContextManager, ExitStack
from importlib.util import find_spec
from typing import Any

from warpbrain.ensemble.sample import Outcome, failure
from warpbrain.ensemble.workers import ENOUGH, Job, Prepare, compute_part, kind_of, parts_of
from warpbrain.errors import InputError

#: Seconds to wait for a scheduler to answer, and for its first worker.
_PATIENCE = 30
#: Workers of this machine that may die of a part until nobody takes it; other schedulers have their own count.
_DEATHS = 2


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
    part. `InputError` if Dask is not installed, or no scheduler or worker answers.
    """

    def __init__(self, address: str, workers: int, device: str | None, batch: int | None, prepare: Prepare) -> None:
        count = local_workers(address)
        if find_spec("distributed") is None:
            raise InputError('--dask: needs the dask extra: pip install "warpbrain[dask]"')
        # what it logs of workers that come and go is no news to a user; errors come as exceptions
        logging.getLogger("distributed").setLevel(logging.CRITICAL)
        self._device, self._batch, self._prepare = device, batch, prepare
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
            self.kind = str(self._client.submit(_kind, device, prepare, pure=False).result())
            self._count = len(self._client.scheduler_info(n_workers=-1)["workers"])
            self.name = f"{self._count} workers of {self._client.scheduler.address}"
            # nothing went wrong: it is closed by this object's own context
            self._stack = stack.pop_all()

    def __exit__(self, *_error: object) -> None:
        self._stack.close()

    def outcomes(self, job: Job) -> Iterator[list[Outcome]]:
        """See `Workers`; `InputError` if a worker has other versions than this machine, or no such device."""
        import distributed

        pending: dict[str, Job] = {}
        # samples that workers died of: one that only waited at such a worker counts as one of them, so each is computed
        # again with nothing beside it before it is blamed
        suspects: list[int] = []
        alone = False

        def submit(part: Job) -> Any:
            future = self._client.submit(compute_part, part, self._device, self._batch, self._prepare, pure=False)
            pending[future.key] = part
            return future

        parts = parts_of(job, self._count, self._batch or ENOUGH[self.kind])
        ending = distributed.as_completed([submit(part) for part in parts])
        for future in ending:
            part = pending.pop(future.key)
            try:
                yield future.result()
            except distributed.KilledWorker as error:
                numbers = [sample.number for sample in part.samples]
                if len(numbers) > 1:
                    ending.update([submit(part.part({number})) for number in numbers])
                elif not alone:
                    suspects += numbers
                else:
                    count, last = error.allowed_failures + 1, error.last_worker.address
                    reason = f"{count} workers died while they computed it, the last one {last}"
                    yield [failure(numbers[0], f"{reason}: out of memory? Their logs say more")]
            # it is written: the scheduler may forget it
            future.release()
            if not pending and suspects:
                alone = True
                ending.add(submit(job.part({suspects.pop(0)})))


def _connect(stack: ExitStack, address: str, workers: int | None) -> Any:
    """A client of a scheduler, or of a new cluster of so many processes of this machine."""
    import dask
    import distributed

    if workers is None:
        return stack.enter_context(distributed.Client(address, timeout=_PATIENCE))
    with dask.config.set({"distributed.scheduler.allowed-failures": _DEATHS - 1}):
        cluster = distributed.LocalCluster(
            n_workers=workers, threads_per_worker=1, processes=True, dashboard_address=":0", silence_logs="CRITICAL"
        )
    return stack.enter_context(distributed.Client(stack.enter_context(cluster)))


def _kind(device: str | None, prepare: Prepare) -> str:
    prepare()
    return kind_of(device)
