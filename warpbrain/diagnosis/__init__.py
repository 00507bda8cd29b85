"""What a simulation left out: where it and the recordings differ, what would explain it, and whether it does.

`diagnose` weighs sets of causes of a body (`worlds.body`), or leaves a specimen to its own world. `checking` checks
the likeliest set, `ranking` tells of every cause, `locating` of what has no name, `onset` since when, `measuring` what
these data and others could tell; `sentences` say it. All ends in `result`.
"""
