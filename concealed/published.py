"""What the paper publishes of its clinical cases that an observation must match."""

from __future__ import annotations

#: Observed nodes of the ventricles and of the resection margin (Table 5).
OBSERVED: dict[str, tuple[int, int]] = {
    "0529": (263, 26),
    "0614": (196, 26),
    "0660": (198, 32),
    "0685": (164, 30),
    "0535": (174, 27),
    "0555": (140, 30),
    "0603": (169, 42),
    "0684": (137, 38),
}
NAMES = tuple(OBSERVED)

#: Medians over the eight of the root mean square motion before any model [mm]: ventricles, cavity.
MEDIANS = (1.37, 5.89)
