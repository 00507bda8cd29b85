"""How far long work has come, on standard error: a bar on a terminal, and now and then a line in a file or pipe."""

import sys
import time
from contextlib import AbstractContextManager

#: Seconds between two lines where there is no terminal: what is done sooner is not worth one.
EVERY = 30.0


class Progress(AbstractContextManager["Progress"]):
    """Shows how far long work has come; as a context it takes its bar away at the end, however that comes."""

    def __init__(self, label: str, quiet: bool = False) -> None:
        self._label = label
        self._quiet = quiet
        self._bar = not quiet and sys.stderr.isatty()
        self._said = time.monotonic()

    def __exit__(self, *error: object) -> None:
        self.clear()

    def show(self, fraction: float, note: str = "") -> None:
        """Draw the bar at a fraction in [0, 1]."""
        share = min(max(fraction, 0.0), 1.0)
        if self._bar:
            done = round(30 * share)
            bar = "#" * done + "." * (30 - done)
            shown = f"\r{self._label} [{bar}] {100 * fraction:3.0f} % {note:<40.40}"
            print(shown, end="", file=sys.stderr, flush=True)
        elif not self._quiet and time.monotonic() - self._said >= EVERY:
            self._said = time.monotonic()
            print(f"{self._label.strip()} {100 * share:.0f} % {note}".rstrip(), file=sys.stderr, flush=True)

    def clear(self) -> None:
        """Take the bar away."""
        if self._bar:
            print("\r" + " " * (len(self._label) + 82), end="\r", file=sys.stderr, flush=True)
