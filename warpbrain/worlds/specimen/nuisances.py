"""What may explain a difference before any cause is credited with it: each with the size it is known to have.

    stress = exp(m) prod_s exp(v_s) (simulated + second invariant) x factors + zero offsets + drifts

Every size is one of `priors.toml`: of the modulus `m`, of specimens of one tissue, of what glued ends do, of a law that
stiffens a little (a factor on all of the stress, what it remembers among it) or depends on the second invariant, and of
the zero of a gauge and its drift.
"""

from __future__ import annotations

import numpy as np

from warpbrain.arrays import Floats
from warpbrain.inference.beliefs import belief
from warpbrain.worlds.specimen.actions import Baseline
from warpbrain.worlds.specimen.effects.law_shape import excess_rows, invariant_rows
from warpbrain.worlds.specimen.effects.not_physics import specimen_rows


class Nuisances:
    """Coefficients, each normal with mean 0 and standard deviation 1.

    Parameters
    ----------
    rows : Baseline
    shape_of_law : bool
        Whether the shape of the law and ends are among them: `run` has none but the case's.

    Attributes
    ----------
    logarithmic, scaled, added : (n, k) arrays
        Change of the logarithm of all stress; of the simulated stress before it is scaled; and after [Pa].
    """

    def __init__(self, rows: Baseline, shape_of_law: bool = True) -> None:
        protocol = rows.protocol
        logs, self.names = [belief("specimen.modulus") * np.ones(len(protocol))], ["modulus"]
        if len(protocol.specimens) > 1:
            logs += list(belief("specimen.specimens") * specimen_rows(protocol).T)
            self.names += [f"specimen {name}" for name in protocol.specimens]
        if shape_of_law:
            I = invariant_rows(protocol)
            k = belief("specimen.stiffening")
            logs.append(k * I / (1.0 + k * I))
            self.names.append("stiffening")
            if bool(np.any(rows.glued != 1.0)):
                # 1 standard deviation leaves a homogeneous state
                logs.append(-belief("specimen.ends") * np.log(rows.glued))
                self.names.append("ends that hold less")
        self.logarithmic = np.column_stack(logs)
        shape = belief("specimen.second_invariant") * excess_rows(rows)
        self.scaled = shape[:, None] if shape_of_law else np.zeros((len(protocol), 0))
        self.names += ["second invariant"] if shape_of_law else []
        added = []
        for number, test in enumerate(protocol.tests):
            own = protocol.mask([number]).astype(float)
            added.append(belief("specimen.zero") * test.peak * own)
            self.names.append(f"zero of {test.name}")
            if test.time is not None:
                own[protocol.rows[number]] = test.share - 0.5
                added.append(belief("specimen.drift") * test.peak * own)
                self.names.append(f"drift in {test.name}")
        self.added = np.column_stack(added)

    def __len__(self) -> int:
        return len(self.names)

    def split(self, z: Floats) -> tuple[Floats, Floats, Floats]:
        """Coefficients of the logarithmic, the scaled and the added ones."""
        a = self.logarithmic.shape[1]
        b = a + self.scaled.shape[1]
        return z[:a], z[a:b], z[b : len(self)]
