"""What a user of the referee gave is wrong."""

from __future__ import annotations


class InputError(ValueError):
    """The message names the file and what is wrong with it; the exit status is 2."""
