"""The referee of the diagnosis: makes cases in which physics is missing by other means than the tool's, and scores.

Not part of the installed package, and nothing in `warpbrain` imports or opens it: the arrow points one way. See
docs/referee.md.
"""
