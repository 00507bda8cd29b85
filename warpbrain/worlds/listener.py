"""Who is told what a long piece of work does."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class Listener:
    """Told what a diagnosis does.

    Attributes
    ----------
    stage : callable
        With a sentence, when something new begins.
    progress : callable
        With a part from 0 to 1 and a word.
    """

    stage: Callable[[str], None] = lambda _text: None
    progress: Callable[[float, str], None] = lambda _part, _word: None
