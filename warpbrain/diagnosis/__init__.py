"""What a simulation left out: where it and the recordings differ, what would explain it, and whether it does.

`diagnose` weighs sets of causes of a body (`worlds.body`), or leaves a specimen to its own world. `confirming` and
`held_out` check the likeliest set, `ranking` tells of every cause, `locating` and `traits` of what has no name, `onset`
since when, `telling_apart` and `measuring` what these data and others could tell; `sentences` say it. All ends in
`result`.
"""
