"""Launches on all cores of a CPU: Warp runs a kernel of the CPU on one thread, this on a team of them.

A kernel whose first argument is called ``start`` takes its index from ``start + wp.tid()``: on the CPU its items are
cut into parts, and threads of the team take one after the other (`launch`). A kernel whose first arguments are
``thread, threads`` runs once for each thread (`launch_together`). What a kernel writes must not depend on how many
threads there are; then the bits do not either. On a GPU `launch` is `wp.launch`.

No thread waits for another to come, only for parts that others have begun: on a machine that has other work as well
the asking thread does what the others do not get to. How many there are say ``OMP_NUM_THREADS`` and the scheduler
(`warpbrain.threads.thread_count`). The team is one for a process: a launch while it is busy, or within a part of
`warpbrain.threads.in_threads`, runs on one thread.

In a captured graph (`Graph`) a launch is a call of `share`, which hands its parts to threads that are in `work` for as
long as the graph is replayed. All of this happens outside of Python.
"""

from __future__ import annotations

import ctypes
import os
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext
from functools import cache
from itertools import pairwise
from queue import SimpleQueue
from typing import Any

import numpy as np
import warp as wp
from warp._src.context import _build_cpu_args_structs

from warpbrain.kernels.module import compiled_module, threads_of_block
from warpbrain.threads import is_part, thread_count

#: Items of a launch below which it stays on one thread: some 20 us of work, about what it takes to share it out.
_LEAST = 512

# Words (64 bits) of a team's memory, each alone on a cache line: the ticket, which counts tasks, parts of the task and
# parts that were taken; parts that are done; whether threads are to look for work; the task.
_LINE = 8
_TICKET, _DONE, _OPEN, _TASK = (line * _LINE for line in range(4))
_WORDS = 4 * _LINE

#: Gives way to other threads after it was called in vain for some microseconds. Of native code of this floor.
PAUSE = """
    auto pause = [&](unsigned& tries) {
        if (++tries > 200) ((void (*)())give_way)();
#if defined(__x86_64__)
        else __builtin_ia32_pause();
#endif
    };
"""
# A task: its number of parts, the kernel, then bounds and arguments of the whole and of each part.
_HELP = (
    PAUSE
    + f"""
    typedef unsigned long long word;
    typedef void (*kernel_type)(void*, void*);
    word* words = (word*)team;
    auto help = [&]() {{
        bool helped = false;
        for (;;) {{
            word ticket = __atomic_load_n(words + {_TICKET}, __ATOMIC_ACQUIRE);
            if ((ticket & 0xffff) >= (ticket >> 16 & 0xffff)) return helped;
            ticket = __atomic_fetch_add(words + {_TICKET}, 1, __ATOMIC_ACQ_REL);
            if ((ticket & 0xffff) >= (ticket >> 16 & 0xffff)) return helped;
            word* part = (word*)words[{_TASK}] + 4 + 2 * (ticket & 0xffff);
            ((kernel_type)((word*)words[{_TASK}])[1])((void*)part[0], (void*)part[1]);
            __atomic_fetch_add(words + {_DONE}, 1, __ATOMIC_ACQ_REL);
            helped = true;
        }}
    }};
    unsigned tries = 0;
"""
)


@wp.func_native(
    _HELP
    + f"""
    word* parts = (word*)task;
    if (!words[{_OPEN}]) {{
        ((kernel_type)parts[1])((void*)parts[2], (void*)parts[3]);
        return;
    }}
    words[{_DONE}] = 0;
    words[{_TASK}] = task;
    const word sequence = (words[{_TICKET}] >> 32) + 1;
    __atomic_store_n(words + {_TICKET}, sequence << 32 | parts[0] << 16, __ATOMIC_RELEASE);
    help();
    while (__atomic_load_n(words + {_DONE}, __ATOMIC_ACQUIRE) < parts[0]) pause(tries);
    """
)
def _share(team: wp.uint64, give_way: wp.uint64, task: wp.uint64): ...


@wp.func_native(
    _HELP
    + f"""
    while (__atomic_load_n(words + {_OPEN}, __ATOMIC_ACQUIRE))
        if (help()) tries = 0;
        else pause(tries);
    """
)
def _work(team: wp.uint64, give_way: wp.uint64): ...


@cache
def team_kernels() -> tuple[Any, Any]:
    """`share`, with which a task is handed to the team, and `work`, in which its threads are."""
    module = compiled_module("multicore")

    @wp.kernel(module=module)
    def share(team: wp.uint64, give_way: wp.uint64, task: wp.uint64):
        _share(team, give_way, task)

    @wp.kernel(module=module)
    def work(team: wp.uint64, give_way: wp.uint64):
        _work(team, give_way)

    return share, work


class _Calls:
    """A launch on the CPU, ready to be called: as a whole and in parts."""

    def __init__(self, kernel: Any, dim: Any, inputs: Sequence[Any], device: Any, changes: Sequence[dict[str, int]]):
        """`changes`: of each part, its arguments by name that are not as given, and its ``count`` of items."""
        recorded = wp.launch(kernel, dim=dim, inputs=list(inputs), device=device, record_cmd=True)
        whole, _ = _build_cpu_args_structs(recorded.kernel, recorded.hooks, recorded.params, False)
        self.function = recorded.hooks.forward
        self.parts: list[tuple[Any, Any]] = [(recorded.params[0], whole)]
        for change in changes:
            bounds = type(recorded.params[0]).from_buffer_copy(recorded.params[0])
            arguments = type(whole).from_buffer_copy(whole)
            for name, value in change.items():
                if name == "count":
                    bounds.size = bounds.size // bounds.shape[0] * value
                    bounds.shape[0] = value
                else:
                    setattr(arguments, name, value)
            self.parts.append((bounds, arguments))
        # what the arguments point to, and the code
        self._kept = recorded

    def table(self) -> Any:
        """What `share` is given."""
        function = ctypes.cast(self.function, ctypes.c_void_p).value
        flat = [ctypes.addressof(struct) for part in self.parts for struct in part]
        return np.array([len(self.parts) - 1, function, *flat], dtype=np.uint64)

    def run(self) -> None:
        """Run the whole."""
        bounds, arguments = self.parts[0]
        self.function(ctypes.byref(bounds), ctypes.byref(arguments))


class _Team:
    """Threads that stay, in one process; the thread that asks is the first of them."""

    def __init__(self, count: int) -> None:
        self.count = count
        self.busy = threading.Lock()
        self._words = np.zeros(_WORDS, dtype=np.uint64)
        self.address = self._words.ctypes.data
        _, work = team_kernels()
        self._work = _Calls(work, 1, [self.address, give_way()], wp.get_device("cpu"), [])
        self._calls: list[SimpleQueue[None]] = [SimpleQueue() for _ in range(count - 1)]
        for calls in self._calls:
            threading.Thread(target=self._serve, args=(calls,), daemon=True).start()

    def _serve(self, calls: SimpleQueue[None]) -> None:
        while True:
            calls.get()
            self._work.run()

    @contextmanager
    def working(self) -> Iterator[bool]:
        """Context in which the other threads of the team look for work; nobody waits until they come or go.

        Yields True, or False if they work in another such context already and the body has to do without them.
        """
        if not self.busy.acquire(blocking=False):
            yield False
            return
        self._words[_OPEN] = 1
        try:
            for calls in self._calls:
                # who was called before and has not come yet comes now
                if calls.empty():
                    calls.put(None)
            yield True
        finally:
            self._words[_OPEN] = 0
            self.busy.release()


@cache
def give_way() -> int:
    """Address of the system's function that lets other threads run."""
    if sys.platform == "win32":
        return ctypes.cast(ctypes.WinDLL("kernel32").SwitchToThread, ctypes.c_void_p).value or 0
    return ctypes.cast(ctypes.CDLL(None).sched_yield, ctypes.c_void_p).value or 0


@cache
def _team_of(count: int, process: int) -> _Team:
    return _Team(count)


def _team() -> _Team | None:
    """The team of this process; None where there is one thread."""
    count = 1 if is_part() else thread_count()
    return _team_of(count, os.getpid()) if count > 1 else None


def launch(kernel: Any, dim: Any, inputs: Sequence[Any], device: Any, least: int = _LEAST) -> None:
    """Launch a kernel on a device; on a CPU on all its cores, if its first argument is called ``start``.

    `inputs` are without ``start``; ranges are of the first dimension of `dim`, and `least` items are worth a part.
    """
    divides = kernel.adj.args[0].label == "start"
    inputs = [0, *inputs] if divides else inputs
    team = _team() if divides and device.is_cpu else None
    items = dim if isinstance(dim, int) else dim[0]
    # twice as many as threads, so that what is left at the end is small
    count = 1 if team is None else min(2 * team.count, items // least)
    if team is None or count < 2:
        wp.launch(kernel, dim=dim, inputs=list(inputs), device=device, block_dim=threads_of_block(device))
        return
    bounds = [items * part // count for part in range(count + 1)]
    changes = [{"start": first, "count": last - first} for first, last in pairwise(bounds)]
    _run(team, kernel, dim, inputs, device, changes)


def launch_together(kernel: Any, items: int, inputs: Sequence[Any], device: Any) -> None:
    """Run a kernel of the CPU once for each of as many threads as so many items are worth.

    Its first arguments are ``thread, threads``, `inputs` those after them. It must not matter how many of the threads
    ever come.
    """
    team = _team()
    count = 1 if team is None else min(team.count, items // _LEAST)
    if team is None or count < 2:
        wp.launch(kernel, dim=1, inputs=[0, 1, *inputs], device=device)
        return
    changes = [{"thread": thread, "threads": count} for thread in range(count)]
    _run(team, kernel, 1, [0, 1, *inputs], device, changes)


def _run(
    team: _Team, kernel: Any, dim: Any, inputs: Sequence[Any], device: Any, changes: Sequence[dict[str, int]]
) -> None:
    """Run a launch in parts, now or whenever the graph is replayed that is being captured."""
    graph = Graph.recording()
    if device.is_capturing and graph is None:
        wp.launch(kernel, dim=dim, inputs=list(inputs), device=device)
        return
    calls = _Calls(kernel, dim, inputs, device, changes)
    table = calls.table()
    share, _ = team_kernels()
    task = [team.address, give_way(), table.ctypes.data]
    if graph is not None:
        graph.keep(team, calls, table)
        wp.launch(share, dim=1, inputs=task, device=device)
        return
    with team.working() as together:
        if together:
            wp.launch(share, dim=1, inputs=task, device=device)
        else:
            calls.run()


class Graph:
    """Launches on a device that are captured once and replayed."""

    _being_recorded = threading.local()

    def __init__(self, device: Any) -> None:
        self._device = device
        self._graph: Any = None
        self._team: _Team | None = None
        self._kept: list[Any] = []

    @classmethod
    def recording(cls) -> Graph | None:
        """The graph that this thread is capturing, if any."""
        return getattr(cls._being_recorded, "graph", None)

    def keep(self, team: _Team, *things: Any) -> None:
        """Keep the team and what the captured launches need for as long as the graph is."""
        self._team = team
        self._kept.append(things)

    @contextmanager
    def capture(self) -> Iterator[None]:
        """Capture what is launched in the body instead of running it."""
        Graph._being_recorded.graph = self
        try:
            with wp.ScopedCapture(device=self._device) as captured:
                yield
        finally:
            Graph._being_recorded.graph = None
        self._graph = captured.graph

    def launch(self) -> None:
        """Run what was captured."""
        with self._team.working() if self._team is not None and self._team is _team() else nullcontext():
            wp.capture_launch(self._graph)
