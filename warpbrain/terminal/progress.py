"""A progress bar on standard error, on a terminal only; and plain lines on standard output."""

from __future__ import annotations

import sys


class Progress:
    """Shows how far long work has come; silent where there is nobody to look at it."""

    def __init__(self, label: str, quiet: bool = False) -> None:
        self._label = label
        self._shown = not quiet and sys.stderr.isatty()

    def show(self, fraction: float, note: str = "") -> None:
        """Draw the bar at a fraction in [0, 1]."""
        if not self._shown:
            return
        done = round(30 * min(max(fraction, 0.0), 1.0))
        bar = "#" * done + "." * (30 - done)
        sys.stderr.write(f"\r{self._label} [{bar}] {100 * fraction:3.0f} % {note:<40.40}")
        sys.stderr.flush()

    def clear(self) -> None:
        """Take the bar away."""
        if self._shown:
            sys.stderr.write("\r" + " " * (len(self._label) + 82) + "\r")
            sys.stderr.flush()
