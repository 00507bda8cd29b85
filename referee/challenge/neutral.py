"""The neutral format of a case: arrays in a `.npz`, to be read with NumPy alone."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from referee.errors import InputError

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Strings = NDArray[np.str_]

#: Version of the format, a number in each file.
VERSION = 1
#: What is stored in single precision: columns are no more accurate than that.
_SINGLE = ("noise_covariance", "nuisance_response", "cause_response", "site_response")


@dataclass(frozen=True, eq=False, kw_only=True)
class NeutralCase:
    """What was recorded of a case, and what would have been of anything small; SI units, axes of the case.

    Attributes
    ----------
    name : str
    sensor_place, sensor_direction : (rows, 3) array
        Where at rest [m] and along which unit vector.
    sensor_kind : (rows,) array of str
        "displacement" [m], "wall" (displacement along the normal of a surface whose points have no partners) [m] or
        "force" [N].
    sensor_point : (rows,) int array
        Rows of the same number are one measurement; a gross error is in all of them.
    sensor_time : (rows,) array
        [s]; NaN where no time is told.
    recorded, predicted : (rows,) array
        What was recorded, and what the declared body does; [m] or [N].
    sigma_declared : bool
        Whether the case declares the noise of its points; if not the covariance assumes 0.35 mm.
    noise_covariance : (rows, rows) array
        Of noise; gross errors are not in it.
    nuisance_name : (k,) array of str
    nuisance_response : (rows, k) array
        Of one standard deviation of each thing that is not known and is no missing physics.
    cause_name : (columns,) array of str
    cause_candidate : (columns,) int array
        Columns of the same number are one cause at one place: directions of one traction.
    cause_place : (columns, 3) array
        [m]; NaN of one that acts everywhere.
    cause_length : (columns,) array
        Radius [m], depth of fluid [m] or relaxation time [s]; NaN if there is none.
    cause_amount, cause_unit : (columns,) arrays
        To which a column responds.
    cause_response : (rows, columns) array
        [m] or [N]
    site_place : (s, 3) array
        [m]
    site_response : (rows, s, 3) array
        Of 1 N along each axis: the compliance [m/N], of force rows [N/N].
    """

    name: str
    sensor_place: Floats
    sensor_direction: Floats
    sensor_kind: Strings
    sensor_point: Ints
    sensor_time: Floats
    recorded: Floats
    predicted: Floats
    sigma_declared: bool
    noise_covariance: Floats
    nuisance_name: Strings
    nuisance_response: Floats
    cause_name: Strings
    cause_candidate: Ints
    cause_place: Floats
    cause_length: Floats
    cause_amount: Floats
    cause_unit: Strings
    cause_response: Floats
    site_place: Floats
    site_response: Floats

    @property
    def residual(self) -> Floats:
        """What the declared body leaves unexplained (rows,) [m] or [N]."""
        return self.recorded - self.predicted

    @property
    def covariance(self) -> Floats:
        """Covariance (rows, rows) of noise and of all nuisances."""
        return self.noise_covariance + self.nuisance_response @ self.nuisance_response.T


def write_case(file: Path, case: NeutralCase) -> None:
    """Write a case; the same case gives the same arrays."""
    stored = {field.name: getattr(case, field.name) for field in fields(case)}
    stored |= {name: np.asarray(stored[name], dtype=np.float32) for name in _SINGLE}
    np.savez_compressed(file, version=VERSION, **stored)


def read_case(file: Path) -> NeutralCase:
    """Read a case; `InputError` naming the file if it is not one."""
    try:
        with np.load(file, allow_pickle=False) as stored:
            if int(stored["version"]) != VERSION:
                raise InputError(f"{file}: version {int(stored['version'])} of the format, expected {VERSION}")
            arrays = {field.name: stored[field.name] for field in fields(NeutralCase)}
    except (OSError, KeyError, ValueError, EOFError, BadZipFile) as error:
        raise InputError(f"{file}: not a case of the challenge: {error}") from None
    arrays |= {name: arrays[name].astype(np.float64) for name in _SINGLE}
    return NeutralCase(**{**arrays, "name": str(arrays["name"]), "sigma_declared": bool(arrays["sigma_declared"])})
