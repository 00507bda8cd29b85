"""What a report of a defect needs: versions, devices, memory, the folder of kernels, and whether devices are right.

Whether they are says a test of a few seconds whose answer is known: a block whose whole surface is moved as one
homogeneous deformation must deform so inside, whatever its mesh (the patch test: Irons and Razzaque 1972). Assembly,
Newton's method and the linear solver all have to be right for that.
"""

import ctypes
import os
import platform
import re
import time
from collections.abc import Callable
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, requires, version
from pathlib import Path
from typing import Any

import numpy as np

from warpbrain import __version__
from warpbrain.bench.command import processor
from warpbrain.cases.shipped import find_case
from warpbrain.errors import SolveError
from warpbrain.mesh import boundary_faces, nodes_of
from warpbrain.physics.laws import NeoHookean
from warpbrain.simulation.equilibrium import solve_equilibrium
from warpbrain.simulation.model import Material, Model
from warpbrain.simulation.system import System
from warpbrain.threads import processors, thread_count

_GIB = 2.0**30


def health(on_test: Callable[[str], None]) -> dict[str, Any]:
    """Look at the machine and run the self-test on each of its devices; Warp must have been started.

    `on_test` is called with the alias of each device before its test. The dictionary is for JSON; memory is in GiB, and
    None where the system does not tell.
    """
    import warp as wp

    devices = []
    for device in wp.get_devices():
        memory = {"total": device.total_memory / _GIB, "free": device.free_memory / _GIB} if device.is_cuda else {}
        devices.append({"alias": device.alias, "name": device.name, "arch": device.arch, "memory_GiB": memory})
    tests = []
    for device in devices:
        on_test(device["alias"])
        tests.append(self_test(device["alias"]))
    cache = Path(wp.config.kernel_cache_dir)
    size = sum(file.stat().st_size for file in cache.rglob("*") if file.is_file())
    return {
        "warpbrain": {"version": __version__, "folder": str(Path(__file__).parents[1])},
        "python": platform.python_version(),
        "platform": platform.platform(),
        "processor": {"name": processor(), "usable": processors(), "threads": thread_count()},
        "memory_GiB": {"total": _memory("SC_PHYS_PAGES"), "free": _memory("SC_AVPHYS_PAGES")},
        "packages": _packages(),
        "devices": devices,
        "cuda": {"driver": _joined(wp.get_cuda_driver_version), "toolkit": _joined(wp.get_cuda_toolkit_version)},
        "kernels": {"folder": str(cache), "size_GiB": size / _GIB, "writable": os.access(cache, os.W_OK)},
        "pictures": _pictures(),
        "self_test": tests,
    }


def _joined(ask: Callable[[], Any]) -> str | None:
    """A version of CUDA as text; None where there is no driver."""
    with suppress(RuntimeError):
        if (version := ask()) and any(version):
            return ".".join(map(str, version))
    return None


def _memory(name: str) -> float | None:
    known = name in getattr(os, "sysconf_names", {})
    return os.sysconf(name) * os.sysconf("SC_PAGE_SIZE") / _GIB if known else None


def _packages() -> dict[str, str | None]:
    """Versions of all that the package's own record requires, extras too; None of what is not installed."""
    try:
        declared = requires("warpbrain") or []
    except PackageNotFoundError:  # run from its sources
        declared = ["warp-lang", "numpy", "scipy", "meshio", "h5py", "matplotlib", "pyvista"]
    versions: dict[str, str | None] = {}
    for line in declared:
        if re.search(r"extra == .(test|docs).", line):
            continue
        [name] = re.findall(r"^[\w.-]+", line)
        versions[name] = None
        with suppress(PackageNotFoundError):
            versions[name] = version(name)
    return versions


def _pictures() -> str | None:
    """Why bodies cannot be drawn; None if nothing is known to be in the way."""
    if platform.system() != "Linux":
        return None
    for library in ("libEGL.so.1", "libOSMesa.so.8"):
        with suppress(OSError):
            ctypes.CDLL(library)
            return None
    return "there is no OpenGL library: on Debian and Ubuntu, apt-get install libegl1"


#: Largest error of a displacement that passes, of the largest displacement: Newton stops at 1e-8 of the forces.
TOLERANCE = 1e-6
#: Stretched by 10 %, squeezed, and sheared.
_GRADIENT = np.array([[1.10, 0.05, 0.0], [0.0, 0.97, 0.0], [0.0, 0.02, 1.0]])


def self_test(device: str) -> dict[str, Any]:
    """Run the test on a device, by its alias.

    `nodes` had to find their place; the largest `error` of one is relative to the largest displacement, NaN if there is
    no equilibrium; `kernels_s` went into loading (the first time compiling) kernels, `solve_s` into the rest; `problem`
    is empty if it passed.
    """
    begun = time.perf_counter()
    mesh = find_case("beam-gravity").mesh
    surface = nodes_of(boundary_faces(mesh.tetrahedra), len(mesh.points))
    exact = mesh.points @ (_GRADIENT - np.eye(3)).T
    model = Model(
        mesh,
        {label: Material(NeoHookean(1000.0)) for label in mesh.labels},
        constrained=np.repeat(surface[:, None], 3, axis=1),
        prescribed=np.where(surface[:, None], exact, 0.0),
    )
    system = System(model, device)
    kernels = system.load_kernels()
    error, problem = np.nan, ""
    try:
        u = solve_equilibrium(system).u
        error = float(np.abs(u - exact).max() / np.abs(exact).max())
    except SolveError as failed:
        problem = str(failed)
    else:
        if not error <= TOLERANCE:
            problem = f"displacements are wrong by {error:.1e} of the largest; expected {TOLERANCE:.0e} at most"
    seconds = time.perf_counter() - begun - kernels
    nodes = int(np.count_nonzero(~surface))
    times = {"kernels_s": kernels, "solve_s": seconds}
    return {"device": device, "nodes": nodes, "error": error, **times, "problem": problem}
