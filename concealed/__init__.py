"""The referee: makes what is observed in the stand-in cases, by physics that the tool is not told.

Not part of the installed package, and nothing in `warpbrain` imports or opens it: the arrow points one way. See
docs/stand-ins.md.
"""
