"""`warpbrain run`: what it was asked for, and what takes long and can be begun while all else is imported and read.

That is to load what renders, in a process of its own, and to compile kernels.
"""

import argparse
import math

from warpbrain.errors import InputError
from warpbrain.report.rendering import ready_to_render
from warpbrain.terminal.quiet import start_warp_quietly


def run(options: argparse.Namespace) -> None:
    """Simulate a case, print what happened and write it."""
    _check(options)
    with ready_to_render():
        start_warp_quietly()
        # begin to compile what every model needs; `System.load_kernels` does the rest
        from warpbrain.kernels.assembly import assembly_kernels
        from warpbrain.kernels.module import begin_loading, find_device, find_precision
        from warpbrain.kernels.multicore import team_kernels

        device, precision = find_device(options.device), find_precision(options.precision)
        # the least one first: until it is compiled others wait
        first = team_kernels()[:1] if device.is_cpu else ()
        begin_loading([*first, assembly_kernels(precision).gather_matrix], device)
        # what this imports takes long, too
        from warpbrain.kernels.linear import solver_kernels

        begin_loading(solver_kernels(precision, device), device)
        # takes as long as all that is imported so far, beside the compiler
        from warpbrain.cli.run_case import run_case

        run_case(options)


def _check(options: argparse.Namespace) -> None:
    """Refuse options that mean nothing together; reads the moduli."""
    if options.mesh_error is not None and options.elements in ("tet10", "tet10-mixed"):
        raise InputError(f"--mesh-error: is not known of --elements {options.elements}: expected tet4 or tet4-averaged")
    if options.mesh_error == "elements" and options.elements == "tet4-averaged":
        raise InputError("--mesh-error elements: compares with tet4-averaged: --mesh-error size says what is left")
    if options.until is not None and options.to_rest:
        raise InputError(f"--until {options.until:g}: means nothing with --to-rest")
    if options.until is not None and options.mesh_error is not None:
        raise InputError(f"--until {options.until:g}: the error of the mesh is not estimated for slow change yet")
    if options.time_step is not None and not options.to_rest:
        raise InputError(f"--time-step {options.time_step:g}: means nothing without --to-rest")
    options.moduli = parse_moduli(options.mu)
    if options.sample is not None and options.mu:
        raise InputError(
            f"--sample {options.sample}: gives every law; --mu {' '.join(options.mu)} means nothing with it"
        )
    if options.sample is None and options.seed is not None:
        raise InputError(f"--seed {options.seed}: means nothing without --sample")


def parse_moduli(values: list[str]) -> dict[int | None, float]:
    """Moduli by label, of ``--mu``: one number for every tissue, whose label is None, or LABEL=PA for some.

    `InputError` if a value is neither, is not positive, or both ways are mixed.
    """
    moduli: dict[int | None, float] = {}
    for value in values:
        label, equals, number = value.rpartition("=")
        try:
            key, mu = int(label) if equals else None, float(number)
        except ValueError:
            raise InputError(f"--mu {value}: expected a number [Pa] or LABEL=PA") from None
        if not (math.isfinite(mu) and mu > 0.0):
            raise InputError(f"--mu {value}: the shear modulus must be a positive number [Pa]")
        if key in moduli:
            once = "expected one number for every tissue, or LABEL=PA for each"
            raise InputError(f"--mu {' '.join(values)}: {once if key is None else f'tissue {key} is given twice'}")
        moduli[key] = mu
    if None in moduli and len(moduli) > 1:
        raise InputError(f"--mu {' '.join(values)}: give one number for every tissue or LABEL=PA for some, not both")
    return moduli
