"""A specimen in a testing machine.

Recordings become stress over strain (`protocol`), mechanisms and other causes become `effects`, which `forward` turns
into stresses by a homogeneous state (`material`) and the factor of glued ends (`glued_ends`). `fit` finds coefficients,
`search` the probable sets of causes, `checks` whether they hold; `diagnose` is all of it, and ends in `result`.
"""
