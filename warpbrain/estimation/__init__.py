"""Tissue parameters from observed deformation: likelihood, estimate, and what the data can tell.

A case and its recordings become rows at a state (`observations`), a state follows from parameters (`parameters`,
`forward`), and both with a prior and nuisances are a `problem`: likelihood times prior, at a point and about it. `fit`
finds its most probable point with the noise that is likely there (`likelihood`) and the error of the mesh
(`finer_mesh`); `sampling` checks it by equilibria. `estimate` is all of it, a `posterior` what comes out.
"""
