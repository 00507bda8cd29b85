"""Many runs: parameter sets on one mesh as one batched simulation, on one device or over many workers.

The package itself can be called: ``warpbrain.ensemble(case, samples=289)`` is `warpbrain.ensemble.run.ensemble`.
"""

from __future__ import annotations

import sys
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from warpbrain.ensemble.results import EnsembleResult


class _Callable(ModuleType):
    """This package, which is a public name of `warpbrain` as well."""

    def __call__(self, *arguments: Any, **named: Any) -> EnsembleResult:
        from warpbrain.ensemble.run import ensemble

        return ensemble(*arguments, **named)


sys.modules[__name__].__class__ = _Callable
