"""The challenge: sealed cases in a neutral format, baselines, scores of any code's answers, a leaderboard.

Nothing that a participant or a scorer needs imports `warpbrain`; `referee.challenge.export` does, which makes the
cases. See docs/challenge.md.
"""
