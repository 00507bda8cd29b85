"""How much longer than alone anything takes on a machine that computes something else, too."""

import time


def slowness(seconds: float = 0.1) -> float:
    """Seconds of the clock for one of a processor, as this thread gets them now: 1 where a processor is free."""
    began, used = time.monotonic(), time.thread_time()
    while time.thread_time() - used < seconds:
        pass
    return max(1.0, (time.monotonic() - began) / (time.thread_time() - used))
