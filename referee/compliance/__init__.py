"""What the declared body of a case does, and what is recorded of any small force on it.

Linear tetrahedra of the declared mesh, the declared law, finite deformation, nothing of the truth: it is all that a
participant of the challenge is given of mechanics. See docs/challenge.md.
"""
