"""Wall time by phase, measured with the device at rest on both sides."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import warp as wp


class PhaseClock:
    """Adds up the wall time of named phases [s] on a device, and counts them."""

    def __init__(self, device: Any) -> None:
        self._device = device
        self.seconds: dict[str, float] = {}
        self.counts: dict[str, int] = {}

    @contextmanager
    def phase(self, name: str) -> Iterator[None]:
        """Time a block as part of a phase."""
        wp.synchronize_device(self._device)
        start = time.perf_counter()
        yield
        wp.synchronize_device(self._device)
        self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - start
        self.counts[name] = self.counts.get(name, 0) + 1
