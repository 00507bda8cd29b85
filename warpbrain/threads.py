"""How many processors there are for this process, and host work of independent parts in as many threads."""

import os
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import AbstractContextManager
from functools import cache
from typing import Any, TypeVar

Part = TypeVar("Part")
Made = TypeVar("Made")

#: Threads at most: factors are read by all of them, and memory is no faster for more.
MOST = 16

#: What was begun beside other work, and may not be done.
_begun: list[Future[Any]] = []
#: Of each thread, whether it is one of those below.
_here = threading.local()


def processors() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def thread_count() -> int:
    """Threads for host work: what the environment variable ``OMP_NUM_THREADS`` says, else one a processor; at most 16.

    Of a list of numbers, as OpenMP allows, the first counts; what is no number is taken for not said, as OpenMP does.
    """
    said = os.environ.get("OMP_NUM_THREADS", "").split(",")[0].strip()
    wanted = int(said) if said.isdecimal() and int(said) > 0 else processors()
    return min(wanted, MOST)


def is_part() -> bool:
    """Whether this is one of several threads already: what is asked for in it stays in it."""
    return getattr(_here, "is_part", False)


def in_threads(work: Callable[[Part], Made], parts: Sequence[Part]) -> list[Made]:
    """What a function makes of each part, in their order.

    It gains where the function leaves Python's lock alone for most of its time. What comes out does not depend on the
    number of threads: each part is worked on by itself, with one thread of BLAS. Parts that ask for threads themselves
    stay in their own.
    """
    count = min(thread_count(), len(parts))
    if is_part():
        return [work(part) for part in parts]
    with one_thread_of_blas():
        if count < 2:
            return [work(part) for part in parts]
        return list(_pool(count, os.getpid()).map(work, parts))


def fill_columns(array: Any, work: Callable[[slice], Any], together: int) -> None:
    """Fill an array (m, k) with what a function makes of each slice of its columns, so many of them a part."""

    def fill(first: int) -> None:
        some = slice(first, first + together)
        array[:, some] = work(some)

    in_threads(fill, range(0, array.shape[1], together))


def beside(work: Callable[[], Made]) -> Callable[[], Made]:
    """Begin something in a thread of its own, if there may be several; what is returned waits for what comes of it."""
    if thread_count() < 2 or is_part():
        return work
    pool = ThreadPoolExecutor(1, initializer=_become_part)
    begun = pool.submit(work)
    pool.shutdown(wait=False)
    _begun[:] = [begun, *(other for other in _begun if not other.done())]
    return begun.result


def is_working_beside() -> bool:
    """Whether what `beside` has begun is not done yet, for which Python waits before it ends."""
    return any(not begun.done() for begun in _begun)


@cache
def _pool(count: int, process: int) -> ThreadPoolExecutor:
    """Threads that stay, in one process: a copy of it would have none of them."""
    return ThreadPoolExecutor(count, initializer=_become_part)


def _become_part() -> None:
    _here.is_part = True


def one_thread_of_blas() -> AbstractContextManager[Any]:
    """While it lasts, products of matrices stay in the thread that asks for them.

    Threads of BLAS wait for each other in a loop: for thousands of small products on processors that have other work
    too that takes many times as long as the products. A diagnosis is made of such products: on 16 idle cores it took
    longer with threads of BLAS than without.
    """
    limited: AbstractContextManager[Any] = _libraries().limit(limits=1, user_api="blas")
    return limited


@cache
def _libraries() -> Any:
    """Libraries with threads of their own; SciPy has another BLAS than NumPy, once it is loaded."""
    import scipy.linalg  # noqa: F401
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()
