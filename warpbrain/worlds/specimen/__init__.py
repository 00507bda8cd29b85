"""A specimen in a testing machine.

Recordings become stress over strain (`protocol`). Mechanisms and other causes become `effects`, of which `fit` makes
stresses by a homogeneous state (`material`) and the factor of glued ends (`glued_ends`), and finds their coefficients.
`search` finds the probable sets of causes, `checks` whether they hold; `diagnose` is all of it, and ends in `result`.
"""
