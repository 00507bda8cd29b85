"""Where kernels are compiled, a named Warp module for each set that is always used together, and for what precision."""

import os
import tempfile
import threading
from collections.abc import Callable, Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp
import warp._src.context as warp_context

from warpbrain.errors import InputError
from warpbrain.threads import thread_count


@dataclass(frozen=True)
class Precision:
    """Warp and NumPy types of one floating-point precision."""

    name: str  # ``"double"`` or ``"single"``
    scalar: Any  # Warp's types
    vec3: Any
    mat33: Any
    numpy: np.dtype[Any]

    @property
    def epsilon(self) -> float:
        """Relative rounding error of one operation."""
        return float(np.finfo(self.numpy).eps)

    @property
    def native(self) -> str:
        """Type of native code."""
        return {"double": "double", "single": "float"}[self.name]


DOUBLE = Precision("double", wp.float64, wp.vec3d, wp.mat33d, np.dtype(np.float64))
SINGLE = Precision("single", wp.float32, wp.vec3f, wp.mat33f, np.dtype(np.float32))
PRECISIONS = {p.name: p for p in (DOUBLE, SINGLE)}


def find_precision(name: str) -> Precision:
    """The precision of a name, ``"double"`` or ``"single"``; `InputError` otherwise."""
    if name not in PRECISIONS:
        raise InputError(f"precision '{name}': expected one of {', '.join(PRECISIONS)}")
    return PRECISIONS[name]


#: Our kernels are chains of 3 x 3 products on one thread. LLVM's SLP vectoriser packs them into shuffles that halve the
#: speed of the matrix-vector product on the CPU; fused multiply-adds help all of them. (The inlining thresholds are
#: Warp's own defaults.) Without effect on CUDA.
_CPU_FLAGS = (
    "-march=native -mllvm=-inline-threshold=9000 -mllvm=-inline-cold-callsite-threshold=3000"
    " -fno-slp-vectorize -ffp-contract=fast"
)

#: Compilers at most: a third gains nothing beside the first module, which the others wait for.
_MOST = 2
#: What was begun to be compiled and may not be done, by process, device and name of the module.
_begun: dict[tuple[int, str, str], Future[None]] = {}


def compiled_module(name: str, unroll: int | None = None) -> Any:
    """The Warp module of a name, with this package's compiler flags; pass it to ``wp.kernel(module=...)``.

    Loops of at most `unroll` turns are unrolled; as many as Warp's default if absent.
    """
    module = wp.get_module(f"warpbrain_{name}")
    module.options["cpu_compiler_flags"] = _CPU_FLAGS
    module.options["enable_backward"] = False
    if unroll is not None:
        module.options["max_unroll"] = unroll
    return module


def native_code(file: str, precision: Precision, **constants: float) -> str:
    """Native code of a file of this floor, after the type `REAL` and constants that it takes for given."""
    code = files("warpbrain.kernels").joinpath(file).read_text(encoding="utf-8")
    given = "".join(f"constexpr auto {name} = {value};\n" for name, value in constants.items())
    return f"using REAL = {precision.native};\n{given}{code}"


def threads_of_block(device: wp.DeviceLike) -> int | None:
    """Of kernels with a thread for an item: few on a GPU, so that some thousand items are shared out to all of it.

    A module is compiled for one number: whoever launches a kernel of those that are loaded ahead says it.
    """
    return 64 if wp.get_device(device).is_cuda else None


def find_device(name: str | None) -> wp.Device:
    """The Warp device of a name (``"cpu"``, ``"cuda:0"``; None for the default one); `InputError` if there is none."""
    try:
        return wp.get_device(name)
    except Exception as error:  # Warp raises RuntimeError or ValueError, by version and cause
        there = ", ".join(device.alias for device in wp.get_devices())
        raise InputError(f"device '{name}': not found on this machine (there are: {there})") from error


class KernelSet:
    """Kernels of one module, by their names: each is one that `add` decorates; see `compiled_module`."""

    def __init__(self, name: str, unroll: int | None = None) -> None:
        self.module = compiled_module(name, unroll)

    def add(self, function: Callable[..., None], together: tuple[int, int] | None = None) -> Any:
        """Make a kernel of a function; of blocks of so many threads, so many are `together` on a multiprocessor."""
        kernel = wp.kernel(function, module=self.module, launch_bounds=together)
        setattr(self, function.__name__, kernel)
        return kernel

    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any: ...


def begin_loading(kernels: Iterable[Any], device: wp.Device) -> Callable[[], None]:
    """Begin to compile the modules of kernels, or to find them in Warp's cache, beside what else is to be done.

    What is returned waits for them, and raises what went wrong. The first of a process is compiled alone: with it Warp
    precompiles its header, which takes longer than four of our modules and which those after it share.
    """
    process = os.getpid()
    compilers = _compilers(process)
    begun = []
    for name, module in {kernel.module.name: kernel.module for kernel in kernels}.items():
        which = process, device.alias, name
        # two threads that find a module missing would both compile it
        if which not in _begun or _begun[which].done():
            _begun[which] = compilers.threads.submit(compilers.load, device, module)
        begun.append(_begun[which])

    def wait() -> None:
        for loaded in begun:
            loaded.result()

    return wait


def is_compiling() -> bool:
    """Whether the threads of `begin_loading` are at work, which nothing stops before they are done."""
    return any(not loaded.done() for loaded in _begun.values())


class _Compilers:
    """Threads that compile modules, several at once for the CPU after the first one has precompiled the header."""

    def __init__(self) -> None:
        self.threads = ThreadPoolExecutor(min(_MOST, thread_count()), thread_name_prefix="compiler")
        self._headers = tempfile.TemporaryDirectory(prefix="wp_pch_")
        self._alone = threading.Lock()

    def load(self, device: wp.Device, module: Any) -> None:
        """Compile a module, or find it."""
        # Warp has a folder of headers for each thread, so that none reads what another has half written
        warp_context.runtime._pch_dirs[threading.get_ident()] = self._headers
        with self._alone:
            if device.is_cuda or not any(Path(self._headers.name).iterdir()):
                wp.force_load(device, [module], threads_of_block(device))
                return
        wp.force_load(device, [module], threads_of_block(device))


@cache
def _compilers(process: int) -> _Compilers:
    return _Compilers()
