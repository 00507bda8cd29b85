"""Launches on all cores of a CPU: Warp runs a kernel of the CPU on one thread, this on a team of them.

A kernel whose first argument is called ``start`` takes its index from ``start + wp.tid()``: on the CPU each thread of
the team has a range of its own (`launch`). A kernel whose first arguments are ``thread, threads, team`` runs once in
each thread, and they wait for each other at `barrier` (`launch_together`). What a kernel writes must not depend on how
many threads there are; then the bits do not either. On a GPU `launch` is `wp.launch`.

How many threads there are say ``OMP_NUM_THREADS`` and the scheduler (`warpbrain.threads.thread_count`). The team is one
for a process: a launch while it is busy, or within a part of `warpbrain.threads.in_threads`, runs on one thread.

In a captured graph (`Graph`) a launch is a call of `share`, which hands the parts to threads that wait in `work` for as
long as the graph is replayed. All of this happens outside of Python; threads that have waited for long give way to
others, so that a machine with other work is not stopped by those that wait.
"""

from __future__ import annotations

import ctypes
import os
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from itertools import pairwise
from queue import SimpleQueue
from typing import Any

import numpy as np
import warp as wp
from warp._src.context import _build_cpu_args_structs

from warpbrain.kernels.module import compiled_module
from warpbrain.threads import MOST, is_part, thread_count

#: Items of a launch below which it stays on one thread: some 20 us of work, about what it takes to share it out.
_LEAST = 512

# Words (32 bits) of a team's memory, each alone on a cache line: how many tasks were handed out, threads that wait for
# them, whether all is to end, addresses of the task and of what gives way, tasks that each thread has done, barriers
# that each has come to, barriers that are open.
_LINE = 16
_SEQUENCE, _WORKERS, _ABORT, _TASK = (line * _LINE for line in range(4))
_DONE = 4 * _LINE
_CAME = _DONE + MOST * _LINE
_OPEN = _CAME + MOST * _LINE
_WORDS = _OPEN + _LINE

_PRELUDE = f"""
    int* words = (int*)team;
    unsigned long long* addresses = (unsigned long long*)(words + {_TASK});
    auto wait_for = [&](int place, int value) {{
        for (int tries = 0; __atomic_load_n(words + place, __ATOMIC_ACQUIRE) < value; ++tries) {{
            if (__atomic_load_n(words + {_ABORT}, __ATOMIC_RELAXED)) return false;
            if (tries > 200) ((void (*)())addresses[1])();
#if defined(__x86_64__)
            else __builtin_ia32_pause();
#endif
        }}
        return true;
    }};
"""


@wp.func_native(
    _PRELUDE
    + f"""
    if (threads < 2) return true;
    const int came = words[{_CAME} + {_LINE} * thread] + 1;
    __atomic_store_n(words + {_CAME} + {_LINE} * thread, came, __ATOMIC_RELEASE);
    if (thread > 0) return wait_for({_OPEN}, came);
    for (int other = 1; other < threads; ++other)
        if (!wait_for({_CAME} + {_LINE} * other, came)) return false;
    __atomic_store_n(words + {_OPEN}, came, __ATOMIC_RELEASE);
    return true;
    """
)
def barrier(thread: int, threads: int, team: wp.uint64) -> bool:
    """Wait for all threads of a launch; False if it is to end at once. Of kernels that are for the CPU alone."""


# A task: its number of parts, the kernel, then bounds and arguments of the whole and of each part.
@wp.func_native(
    _PRELUDE
    + f"""
    typedef void (*kernel_type)(void*, void*);
    unsigned long long* parts = (unsigned long long*)task;
    const int workers = words[{_WORKERS}];
    if (parts && workers + 1 < (int)parts[0]) {{
        ((kernel_type)parts[1])((void*)parts[2], (void*)parts[3]);
        return;
    }}
    for (int place = {_CAME}; place < {_WORDS}; place += {_LINE}) words[place] = 0;
    addresses[0] = task;
    const int sequence = words[{_SEQUENCE}] + 1;
    __atomic_store_n(words + {_SEQUENCE}, sequence, __ATOMIC_RELEASE);
    if (!parts) return;
    ((kernel_type)parts[1])((void*)parts[4], (void*)parts[5]);
    for (int thread = 1; thread <= workers; ++thread)
        if (!wait_for({_DONE} + {_LINE} * thread, sequence)) return;
    """
)
def _share(team: wp.uint64, task: wp.uint64): ...


@wp.func_native(
    _PRELUDE
    + f"""
    typedef void (*kernel_type)(void*, void*);
    for (int sequence = 1; wait_for({_SEQUENCE}, sequence); ++sequence) {{
        unsigned long long* parts = (unsigned long long*)addresses[0];
        if (!parts) return;
        if (thread < (int)parts[0])
            ((kernel_type)parts[1])((void*)parts[4 + 2 * thread], (void*)parts[5 + 2 * thread]);
        __atomic_store_n(words + {_DONE} + {_LINE} * thread, sequence, __ATOMIC_RELEASE);
    }}
    """
)
def _work(thread: int, team: wp.uint64): ...


@cache
def _team_kernels() -> tuple[Any, Any]:
    """`share`, with which a graph hands a task to the team (0: it is over), and `work`, where it waits."""
    module = compiled_module("multicore")

    @wp.kernel(module=module)
    def share(team: wp.uint64, task: wp.uint64):
        _share(team, task)

    @wp.kernel(module=module)
    def work(thread: int, team: wp.uint64):
        _work(thread, team)

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

    def run(self, part: int) -> None:
        """Run a part, of which 0 is the whole."""
        bounds, arguments = self.parts[part]
        self.function(ctypes.byref(bounds), ctypes.byref(arguments))


class _Team:
    """Threads that stay, in one process; the thread that asks is the first of them."""

    def __init__(self, count: int) -> None:
        self.count = count
        self.busy = threading.Lock()
        self.words = np.zeros(_WORDS, dtype=np.int32)
        self.words[_TASK : _TASK + 4].view(np.uint64)[1] = _giving_way()
        self.address = self.words.ctypes.data
        self._tasks: list[SimpleQueue[Any]] = [SimpleQueue() for _ in range(count - 1)]
        for tasks in self._tasks:
            threading.Thread(target=self._serve, args=(tasks,), daemon=True).start()

    def _serve(self, tasks: SimpleQueue[Any]) -> None:
        while True:
            function, argument, ended = tasks.get()
            function(argument)
            ended.release()

    @contextmanager
    def others(self, function: Any, arguments: Sequence[int]) -> Iterator[None]:
        """Let the other threads call a function, each with an argument, while the body runs; then wait for them.

        If the body is left by an exception, an interrupt for example, those that wait at a barrier are told to end.
        """
        self.words[_SEQUENCE] = self.words[_WORKERS] = self.words[_ABORT] = 0
        self.words[_DONE:] = 0
        begun, ended = 0, threading.Semaphore(0)
        try:
            for tasks, argument in zip(self._tasks, arguments, strict=False):
                begun += 1
                tasks.put((function, argument, ended))
            yield
        except BaseException:
            self.words[_ABORT] = 1
            raise
        finally:
            for _ in range(begun):
                ended.acquire()


def _giving_way() -> int:
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


def launch(kernel: Any, dim: Any, inputs: Sequence[Any], device: Any) -> None:
    """Launch a kernel on a device; on a CPU on all its cores, if its first argument is called ``start``.

    Parameters
    ----------
    kernel : wp.Kernel
    dim : int or sequence of int
        Items; ranges are of the first dimension.
    inputs : sequence
        Its arguments, without ``start``.
    device : wp.Device
    """
    divides = kernel.adj.args[0].label == "start"
    inputs = [0, *inputs] if divides else inputs
    team = _team() if divides and device.is_cpu else None
    items = dim if isinstance(dim, int) else dim[0]
    count = 1 if team is None else min(team.count, items // _LEAST)
    if team is None or count < 2:
        wp.launch(kernel, dim=dim, inputs=list(inputs), device=device)
        return
    bounds = [items * part // count for part in range(count + 1)]
    changes = [{"start": first, "count": last - first} for first, last in pairwise(bounds)]
    _run(team, kernel, dim, inputs, device, changes)


def launch_together(kernel: Any, items: int, inputs: Sequence[Any], device: Any) -> None:
    """Run a kernel of the CPU once in each of as many threads as so many items are worth.

    Parameters
    ----------
    kernel : wp.Kernel
        Its first arguments are ``thread, threads, team``.
    items : int
    inputs : sequence
        Its further arguments.
    device : wp.Device
    """
    team = _team()
    count = 1 if team is None else min(team.count, items // _LEAST)
    if team is None or count < 2:
        wp.launch(kernel, dim=1, inputs=[0, 1, 0, *inputs], device=device)
        return
    changes = [{"thread": thread, "threads": count, "team": team.address} for thread in range(count)]
    _run(team, kernel, 1, [0, 1, 0, *inputs], device, changes)


def _run(
    team: _Team, kernel: Any, dim: Any, inputs: Sequence[Any], device: Any, changes: Sequence[dict[str, int]]
) -> None:
    """Run a launch in parts, now or whenever the graph is replayed that is being captured."""
    if device.is_capturing:
        graph = Graph.recording()
        if graph is None:
            wp.launch(kernel, dim=dim, inputs=list(inputs), device=device)
            return
        calls = _Calls(kernel, dim, inputs, device, changes)
        table = calls.table()
        graph.keep(team, calls, table)
        share, _ = _team_kernels()
        wp.launch(share, dim=1, inputs=[team.address, table.ctypes.data], device=device)
        return
    if not team.busy.acquire(blocking=False):
        wp.launch(kernel, dim=dim, inputs=list(inputs), device=device)
        return
    try:
        calls = _Calls(kernel, dim, inputs, device, changes)
        with team.others(calls.run, range(2, len(calls.parts))):
            calls.run(1)
    finally:
        team.busy.release()


class Graph:
    """Launches that are captured once and replayed.

    Parameters
    ----------
    device : wp.Device
    """

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
        if self._device.is_cpu:
            share, _ = _team_kernels()
            share.module.load(self._device)
        Graph._being_recorded.graph = self
        try:
            with wp.ScopedCapture(device=self._device) as captured:
                yield
        finally:
            Graph._being_recorded.graph = None
        self._graph = captured.graph

    def launch(self) -> None:
        """Run what was captured."""
        team = self._team
        if team is None or team is not _team() or not team.busy.acquire(blocking=False):
            wp.capture_launch(self._graph)
            return
        try:
            share, work = _team_kernels()
            waits = [{"thread": thread} for thread in range(1, team.count)]
            calls = _Calls(work, 1, [0, team.address], self._device, waits)
            with team.others(calls.run, range(1, team.count)):
                team.words[_WORKERS] = team.count - 1
                wp.capture_launch(self._graph)
                wp.launch(share, dim=1, inputs=[team.address, 0], device=self._device)
        finally:
            team.words[_WORKERS] = 0
            team.busy.release()
