"""How long the stages of a piece of work take."""

import time
from collections.abc import Iterator
from contextlib import contextmanager


class Seconds(dict[str, float]):
    """Wall time [s] by stage."""

    @contextmanager
    def of(self, stage: str) -> Iterator[None]:
        """Add the time that a block takes to a stage."""
        begun = time.perf_counter()
        yield
        self[stage] = self.get(stage, 0.0) + time.perf_counter() - begun
