"""What `warpbrain doctor` found, in words."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def health_lines(found: Mapping[str, Any]) -> list[str]:
    """As printed; `found` is of `warpbrain.bench.health.health`."""
    memory, processor, cuda, kernels = (found[name] for name in ("memory_GiB", "processor", "cuda", "kernels"))
    installed = [f"{name} {version}" for name, version in found["packages"].items() if version]
    missing = [name for name, version in found["packages"].items() if not version]
    driver = f"CUDA driver {cuda['driver']}" if cuda["driver"] else "no CUDA driver"
    writable = "" if kernels["writable"] else "; CANNOT BE WRITTEN TO: set WARP_CACHE_PATH to a folder that can"
    lines = [
        f"warpbrain  {found['warpbrain']['version']} in {found['warpbrain']['folder']}",
        f"python     {found['python']} on {found['platform']}",
        f"processor  {processor['name']}, {processor['usable']} usable, {processor['threads']} threads",
        f"memory     {_gib(memory['total'])}, {_gib(memory['free'])} free",
        f"installed  {', '.join(installed)}",
        f"optional   {', '.join(missing) or 'nothing'} not installed",
        f"cuda       {driver}, Warp built with {cuda['toolkit'] or 'none'}",
        *(f"device     {device['alias']}: {device['name']}{_of_device(device)}" for device in found["devices"]),
        f"kernels    {kernels['folder']}, {kernels['size_GiB']:.2f} GiB{writable}",
        f"pictures   {found['pictures'] or 'an OpenGL library is there'}",
    ]
    for test in found["self_test"]:
        head = f"self-test  {test['device']}: "
        if test["problem"]:
            lines.append(f"{head}FAILED: {test['problem']}")
        else:
            lines.append(
                f"{head}passed: {test['nodes']} nodes found to {test['error']:.0e} of their displacement in "
                f"{test['solve_s']:.1f} s, after {test['kernels_s']:.1f} s for kernels"
            )
    return lines


def _gib(size: float | None) -> str:
    return "not known" if size is None else f"{size:.1f} GiB"


def _of_device(device: Mapping[str, Any]) -> str:
    memory = device["memory_GiB"]
    if not memory:
        return ""
    return f", architecture {device['arch']}, {_gib(memory['total'])}, {_gib(memory['free'])} free"
