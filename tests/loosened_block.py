"""A block that something holds at its bottom, which lets go on a patch that no scan has the place of."""

import copy
from dataclasses import replace

import numpy as np

from warpbrain.diagnosis.result import Diagnosis
from warpbrain.diagnosis.stage import Stage, compared
from warpbrain.worlds.body.dictionary import candidates_at, dictionary_of, patch_of
from warpbrain.worlds.body.effects import Effects


def loosened(diagnosis: Diagnosis, centre: np.ndarray, radius: float, state: str, seed: int = 2) -> Stage:
    """The stage that screens it, with noise.

    Parameters
    ----------
    diagnosis : Diagnosis
        Of the block.
    centre : (3,) array
        Of the patch [m].
    radius : float
        [m]
    state : str
        What it does there; see `warpbrain.physics.mechanisms.contact`.
    seed : int
    """
    base = diagnosis.base
    mesh = base.at.system.model.mesh
    held = mesh.node_sets["bottom"]
    at = copy.copy(base.at)
    at._surfaces, at._of_surfaces = {}, {}
    at.reactions = np.where(held[:, None], np.array([0.04, 0.02, -0.05]), 0.0)
    base = replace(base, at=at, effects=Effects(at))
    dictionary = dictionary_of(diagnosis.case, ["contact"])
    # what meets a wall where it is free would be solved, and these reactions are of no state
    released = tuple(one for one in dictionary.proposals["contact"] if one.follows == "release")
    candidates = candidates_at(replace(dictionary, proposals={"contact": released}), base.effects, {})
    patch = patch_of(mesh, "bottom", held, centre, radius)
    like = next(e for e in candidates.effects if e.proposed.make(e.proposed.mean).state == state)
    truth = base.effects.of([like.proposed.of_patch(patch)])[0].mean
    residual = truth + base.explanation.factor @ np.random.default_rng(seed).normal(size=len(truth))
    return compared(base, (), candidates, base.explanation, residual, 1.0, 40, np.random.default_rng(3))
