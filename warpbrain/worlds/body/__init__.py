"""A body that was recorded while it deformed.

`base` finds the state about which all is linear, its nuisances (`nuisances`) and its noise. `dictionary` proposes what
may act, `effects` makes columns of it, and `causes` weighs these alike. `hypotheses` screens sets of causes in the
linear model, and fits those on which a verdict may depend without linearising (`fitting`), better placed
(`placing`). What comes out are `weighted_set`s.
"""
