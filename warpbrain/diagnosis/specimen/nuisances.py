"""What may explain a difference before any candidate is credited with it: each with the size it is known to have.

    stress = exp(m) prod_s exp(v_s) (simulated + shape of the law) x factors + zero offsets + drifts

The modulus `m` is free within a factor of 3; specimens of one tissue vary by a fifth; the zero of a gauge and its drift
are a fiftieth of the largest stress; the law may have a share of the second invariant and stiffen a little; what
glued ends do may be twice that of the computed shape or nothing, since glue gives way and cut faces are not flat.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpbrain.diagnosis.specimen.acting import Unit
from warpbrain.diagnosis.specimen.candidates.law_shape import excess_rows, invariant_rows
from warpbrain.diagnosis.specimen.candidates.unlike import specimen_rows
from warpbrain.diagnosis.specimen.protocol import Protocol

Floats = NDArray[np.float64]

#: Standard deviations: logarithms of modulus and of a specimen's, part of what glued ends do, zero and drift of the
#: largest stress, share of the second invariant, stiffening.
MODULUS, SPECIMEN, ENDS, ZERO, DRIFT, SHARE, STIFFENING = 1.1, 0.2, 1.0, 0.02, 0.02, 0.15, 1.0


class Nuisances:
    """Coefficients, each normal with mean 0 and standard deviation 1.

    Parameters
    ----------
    protocol : Protocol
    unit : Unit
    shape_of_law : bool
        Whether the shape of the law and ends are among them: `run` has none but the case's.
    """

    def __init__(self, protocol: Protocol, unit: Unit, shape_of_law: bool = True) -> None:
        several = len(protocol.specimens) > 1
        #: Change of the logarithm of all stress, one column each.
        self.logarithmic = MODULUS * np.ones((len(protocol), 1))
        self.names = ["modulus"]
        if several:
            self.logarithmic = np.column_stack([self.logarithmic, SPECIMEN * specimen_rows(protocol)])
            self.names += [f"specimen {name}" for name in protocol.specimens]
        if shape_of_law and bool(np.any(unit.glued != 1.0)):
            # 1 standard deviation leaves a homogeneous state
            self.logarithmic = np.column_stack([self.logarithmic, -ENDS * np.log(unit.glued)])
            self.names.append("ends that hold less")
        I = invariant_rows(protocol)
        shapes = [SHARE * excess_rows(protocol, unit), STIFFENING * unit.base * I / (1.0 + STIFFENING * I)]
        #: Added to the simulated stress before it is scaled.
        self.scaled = np.column_stack(shapes) if shape_of_law else np.zeros((len(protocol), 0))
        self.names += ["second invariant", "stiffening"] if shape_of_law else []
        added = []
        for number, test in enumerate(protocol.tests):
            rows = protocol.mask([number]).astype(float)
            added.append(ZERO * test.peak * rows)
            self.names.append(f"zero of {test.name}")
            if test.time is not None:
                rows[protocol.rows[number]] = (test.time - test.time[0]) / max(float(np.ptp(test.time)), 1e-12) - 0.5
                added.append(DRIFT * test.peak * rows)
                self.names.append(f"drift in {test.name}")
        #: Added after it is scaled.
        self.added = np.column_stack(added)

    def __len__(self) -> int:
        return len(self.names)

    def split(self, z: Floats) -> tuple[Floats, Floats, Floats]:
        """Coefficients of the logarithmic, the scaled and the added ones."""
        a = self.logarithmic.shape[1]
        b = a + self.scaled.shape[1]
        return z[:a], z[a:b], z[b : len(self)]
