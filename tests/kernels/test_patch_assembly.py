"""Matrices of many samples by patches, on a GPU that has clusters, against those of tangents in memory on the CPU."""

import numpy as np
import pytest
import warp as wp
from bodies import model_of
from many_samples import MODULI, samples_of
from material_point import LAWS
from shapes import box, distorted

from warpbrain.ensemble.batch import Batch
from warpbrain.kernels.batched.cluster import forms_clusters
from warpbrain.kernels.module import Precision
from warpbrain.physics.laws import NeoHookean
from warpbrain.simulation.model import Material
from warpbrain.simulation.system import System

NEAR = {"double": 1e-12, "single": 1e-4}


@pytest.mark.parametrize("law", ["neo-hookean", "ogden 3 terms"])
def test_matrices_of_samples(law: str, device: str, precision: Precision) -> None:
    if not forms_clusters(wp.get_device(device)):
        pytest.skip("on a GPU with clusters only")
    # several patches of each of two laws, or of one
    mesh = distorted(box((6, 6, 10), (0.03, 0.03, 0.05)), 0.0005, tissues=2)
    constrained = np.repeat(mesh.points[:, 2:] < 0.002, 3, axis=1)
    constrained[mesh.points[:, 0] < 0.005, 2] = False
    second = Material(NeoHookean(1200.0), 0.4)
    model = model_of(mesh, Material(LAWS[law], 0.45), second, constrained=constrained)
    samples, slots = samples_of(model), len(MODULI)
    random = np.random.default_rng(3)
    u, k, m = random.normal(scale=2e-4, size=(len(mesh.points), 3, slots)), random.random(slots), random.random(slots)
    order, count = random.permutation(slots), slots - 2
    found = {}
    for where in ("cpu", device):
        batch = Batch(System(model, where, precision.name), samples, slots, tolerance=1e-6)
        batch.place({slot: sample.number for slot, sample in enumerate(samples)})
        for numbers, values in ((batch._samples.u, u), (batch._samples.k, k), (batch._samples.m, 1e3 * m)):
            numbers.assign(values)
        for listed in (batch._start, batch._fresh):
            listed[0].assign(order)
            listed[1].fill_(count)
        assert (batch._patches is None) == (where == "cpu")
        batch._evaluate()
        batch._begin_steps()
        found[where] = batch._cg.values.numpy().astype(float)
        assert not np.any(found[where][:, :, order[count:]])
        found[where + " forces"] = batch._samples.internal.numpy().astype(float)
    expected = found["cpu"]
    scale = np.abs(expected).max(axis=(0, 1))[order[:count]]
    apart = np.abs(found[device] - expected).max(axis=(0, 1))[order[:count]]
    assert np.all(apart < NEAR[precision.name] * scale)
    forces = found["cpu forces"]
    assert np.abs(found[device + " forces"] - forces).max() < NEAR[precision.name] * np.abs(forces).max()
