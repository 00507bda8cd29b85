"""The size of a batch: what a sample takes, what is free, and what pays."""

import numpy as np
import pytest
import warp as wp
from many_samples import samples_of, shaken_block
from material_point import LAWS

from warpbrain.ensemble import workers
from warpbrain.ensemble.batch import Batch
from warpbrain.ensemble.workers import ENOUGH, batch_size, bytes_per_slot, free_bytes
from warpbrain.errors import InputError
from warpbrain.kernels.batched.cluster import forms_clusters
from warpbrain.simulation.system import System


def held(owner: Batch) -> int:
    """Bytes of the arrays on its device that a batch and the objects in it hold, each counted once."""
    found: dict[int, int] = {}

    def visit(value: object, depth: int) -> None:
        if isinstance(value, wp.array) and value.device != owner.system.device:
            return
        if isinstance(value, wp.array):
            found[value.ptr] = value.size * wp._src.types.type_size_in_bytes(value.dtype)
        elif isinstance(value, list | tuple):
            for item in value:
                visit(item, depth)
        elif isinstance(value, wp._src.codegen.StructInstance):
            visit(list(vars(value).values()), depth)
        elif depth and type(value).__module__.startswith("warpbrain") and hasattr(value, "__dict__"):
            for item in vars(value).values():
                visit(item, depth - 1)

    for name, value in vars(owner).items():
        if name != "system":
            visit(value, 2)
    return sum(found.values())


def test_what_a_sample_takes_is_what_is_allocated(device: str, precision) -> None:
    model = shaken_block(LAWS["neo-hookean"])
    samples = samples_of(model)
    system = System(model, device, precision.name)
    few, many = (held(Batch(system, samples, slots, tolerance=1e-6)) for slots in (8, 40))
    # how much several patches of the mesh have in common is not known before there are any
    least = 0.8 if forms_clusters(system.device) else 0.997
    assert least < (many - few) / 32 / bytes_per_slot(system) < 1.003


def test_a_batch_is_what_is_asked_for_or_what_pays(device: str, monkeypatch) -> None:
    system = System(shaken_block(LAWS["neo-hookean"]), device)
    enough = ENOUGH["cuda" if system.device.is_cuda else "cpu"]
    assert batch_size(system) == enough
    assert batch_size(system, 7) == 7
    each = bytes_per_slot(system)
    monkeypatch.setattr(workers, "free_bytes", lambda system: int(10.5 * each))
    assert batch_size(system) == min(enough, 8)
    with pytest.raises(InputError, match=r"--batch 9: a sample takes \d+ MB, and .* has room for 8"):
        batch_size(system, 9)
    monkeypatch.setattr(workers, "free_bytes", lambda system: each // 2)
    with pytest.raises(InputError, match=r"--batch auto: a sample takes \d+ MB, and .* has room for 0"):
        batch_size(system)


def test_there_is_free_memory(device: str) -> None:
    assert free_bytes(System(shaken_block(LAWS["neo-hookean"]), device)) > 2**20
    assert np.isfinite(free_bytes(System(shaken_block(LAWS["neo-hookean"]), device)))
