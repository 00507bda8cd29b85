"""Laws of the samples of a batch on the device: elements by law, a row of parameters for each tissue and slot."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from warpbrain.arrays import Floats
from warpbrain.ensemble.sample import Sample
from warpbrain.errors import InputError
from warpbrain.kernels.batched.elements import BatchedElementKernels, batched_element_kernels
from warpbrain.physics.laws import Law
from warpbrain.simulation.model import Material
from warpbrain.simulation.system import System


def code_of(material: Material) -> tuple[type[Law], str]:
    """What decides which kernels compute a material."""
    return type(material.law), material.formulation


@dataclass(frozen=True)
class BatchGroup:
    """Elements that share a law and formulation."""

    kernels: BatchedElementKernels
    elements: wp.array  # elements, and which tissue of the group each is of
    tissue: wp.array
    parameters: wp.array  # one row for a tissue and a slot, slots fastest
    rows: Floats  # the same on the host, shape (tissues, slots, parameters)
    known: Mapping[int, Floats]  # rows of each sample by its number, shape (tissues, parameters)


class BatchMaterials:
    """The laws of the samples that are in the slots, of all that may ever be placed, each with materials.

    `InputError` if they are not all of the same laws.
    """

    def __init__(self, system: System, samples: Sequence[Sample], slots: int) -> None:
        self._system = system
        self._slots = slots
        by_number = {sample.number: sample.materials for sample in samples if sample.materials is not None}
        first = next(iter(by_number.values()))
        for number, materials in by_number.items():
            for label, material in materials.items():
                if label not in first or code_of(material) != code_of(first[label]):
                    raise InputError(
                        f"sample {number}: tissue {label}: {material.law.name} ({material.formulation}): all samples "
                        "of an ensemble have the same laws, with parameters of their own"
                    )
        labels: dict[tuple[type[Law], str], list[int]] = {}
        for label in sorted(first):
            labels.setdefault(code_of(first[label]), []).append(label)
        self.groups = [self._group(alike, by_number) for alike in labels.values()]

    def _group(self, labels: list[int], samples: Mapping[int, Mapping[int, Material]]) -> BatchGroup:
        system, p = self._system, self._system.precision
        everyone = [materials[label] for materials in samples.values() for label in labels]
        law_type, formulation = code_of(everyone[0])
        # all at once: laws with fewer terms than another get terms of no weight
        laws = law_type.parameter_rows([material.law for material in everyone])
        table = np.array([(m.volumetric_modulus, *row) for m, row in zip(everyone, laws, strict=True)])
        table = table.reshape(len(samples), len(labels), -1)
        # slots that never hold a sample hold the parameters of one, not zeros that a law may divide by
        rows = np.repeat(table[0][:, None], self._slots, axis=1)
        tissue = system.model.mesh.tissue
        members = np.flatnonzero(np.isin(tissue, labels))

        def array(values: Any, dtype: Any) -> wp.array:
            return wp.array(values, dtype=dtype, device=system.device)

        return BatchGroup(
            batched_element_kernels(law_type.device_law(formulation), p),
            array(members, int),
            array(np.searchsorted(labels, tissue[members]), int),
            array(rows.reshape(-1, rows.shape[2]), p.scalar),
            rows,
            dict(zip(samples, table, strict=True)),
        )

    def place(self, numbers: Mapping[int, int]) -> None:
        """Put samples, by their numbers, into slots."""
        for group in self.groups:
            for slot, number in numbers.items():
                group.rows[:, slot] = group.known[number]
            group.parameters.assign(group.rows.reshape(-1, group.rows.shape[2]))
