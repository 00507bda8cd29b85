"""The rule that turns numbers into one of seven verdicts. It was fixed before any case was scored with it.

1. No alarm if the global test is not significant: nothing missing, with what would have been seen.
2. Named if one mechanism is probable enough, predicts points that it was not fitted to better than without it and than
   patterns that mean nothing, has a plausible size, and leaves nothing significant. Named + rest if something is left.
   That may be all of it: then the name must be probable enough beside any force without a name, too.
   What predicts them but little better needs a strong alarm, what does plainly only a significant one.
3. Not physics if nuisances far larger than they should be are as probable together.
4. Group if a few mechanisms together are probable enough. Unknown if a force without a name is, and predicts points
   that it was not fitted to better; or if it may be, and the best mechanism leaves something significant: then a force
   without a name acts in either case. Where the best mechanism leaves nothing, and it and a force without a name are
   probable enough only together: a group of both. Else: cannot say. A weak alarm is never more than that if held-out
   points do not bear it out, nor are recordings of which many points contradict each other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpbrain.diagnosis.result import (
    CANNOT_SAY,
    GROUP,
    NAMED,
    NAMED_AND_REST,
    NOT_PHYSICS,
    NOTHING,
    UNKNOWN,
    Ranked,
)
from warpbrain.diagnosis.screening import UNKNOWN as UNKNOWN_KIND
from warpbrain.worlds.body.not_physics import SENTENCES

Floats = NDArray[np.float64]

#: Probability that a name needs, that a label set needs, and that what is left must have to be noise.
SURE, TOGETHER, ADEQUATE = 0.9, 0.9, 0.01
#: Largest size [standard deviations of its prior] and placebo probability of a name, and members of a group.
LARGEST, PLACEBO, MEMBERS = 4.0, 0.05, 4
#: Part of the probability of a false alarm up to which an alarm is strong: wrong ones, in calibration cases without an
#: effect and in traps, are weak.
CLAIM = 0.2
#: Part of the recorded points that may be gross errors: of more it is the pairing that is in doubt, not single points.
CONTRADICTED = 0.1
#: How much more probable [nats] held-out points are without the block that gains most, where that is plain: ten times.
TENFOLD = float(np.log(10.0))


@dataclass(frozen=True)
class Evidence:
    """What the rule looks at.

    Attributes
    ----------
    alpha, p_value : float
    chance : float
        Of an alarm as strong as this one where nothing is missing, refits included: `p_value`, or one over the Bayes
        factor of anything against nothing, which is exceeded no more often than that (Markov's inequality).
    ranking : tuple of Ranked
        The most probable first.
    gain : float
        By how much [nats] the most probable one makes held-out points more probable, of regions where it acts in more
        than one place.
    sure : float
        The same without the block that gains most, of regions or of points here and there: what acts in few places is
        in few regions, and what a neighbour tells is no gain here and there.
    placebo_p, adequacy_p : float
        Of it.
    needed : float
        Probability that it acts, against nothing more; where something is left, against a force without a name, too.
    size : float
        Its largest coefficient in standard deviations of the prior.
    unknown_sure : float
        What `sure` is, of a force without a name.
    aside : float
        Part of the recorded points that were set aside as gross errors.
    set_aside : int
        How many.
    """

    alpha: float
    p_value: float
    chance: float
    ranking: Sequence[Ranked]
    gain: float
    sure: float
    placebo_p: float
    adequacy_p: float
    needed: float
    size: float
    unknown_sure: float
    aside: float
    set_aside: int

    @property
    def strong(self) -> bool:
        """Whether the alarm is."""
        return self.chance <= CLAIM * self.alpha

    @property
    def plain(self) -> bool:
        """Whether the alarm is strong, or held-out points bear it out."""
        return self.strong or self.sure > TENFOLD

    def paired(self, sure: float) -> bool:
        """Whether points are not paired so badly that nothing can be said.

        Not more than one in ten contradicts all others; or held-out points are more probable, `sure`, by more than
        could be if each of them had its part in it: what comes of wrong pairs does not predict others.
        """
        return self.aside <= CONTRADICTED or sure > self.set_aside * TENFOLD


@dataclass(frozen=True)
class Verdict:
    """What the rule says.

    Attributes
    ----------
    verdict : str
    kinds : tuple of str
        Named, or of the group; of the unknown what comes nearest and leaves something, if that may act beside it.
    why : str
        What kept it from a name, if something did.
    """

    verdict: str
    kinds: tuple[str, ...]
    why: str = ""

    @property
    def adds(self) -> bool:
        """Whether it names a mechanism."""
        return self.verdict in (NAMED, NAMED_AND_REST)


@dataclass(frozen=True)
class Conclusion:
    """What the verdicts of all stages come to: each looks for what acts beside those that were named before it.

    Attributes
    ----------
    verdict : str
    kinds : tuple of str
        That are named, or of a group, or no physics.
    rest : Verdict or None
        Of what is left beside what is named, if that is significant.
    why : str
        What kept a name from being spoken.
    """

    verdict: str
    kinds: tuple[str, ...]
    rest: Verdict | None = None
    why: str = ""


def overall(verdicts: Sequence[Verdict]) -> Conclusion:
    """Of one stage after the other: names are added while the rule gives them, and the last says what is left."""
    adding = [verdict for verdict in verdicts if verdict.adds]
    if not adding:
        return Conclusion(verdicts[0].verdict, verdicts[0].kinds, None, verdicts[0].why)
    after = verdicts[len(adding) :]
    rest = after[0] if after and adding[-1].verdict == NAMED_AND_REST else None
    return Conclusion(adding[-1].verdict, tuple(verdict.kinds[0] for verdict in adding), rest)


def decide(found: Evidence) -> Verdict:
    """Apply the rule."""
    if found.p_value > found.alpha:
        return Verdict(NOTHING, ())
    best = found.ranking[0]
    if best.kind in SENTENCES and sum(one.probability for one in found.ranking if one.kind in SENTENCES) >= SURE:
        return Verdict(NOT_PHYSICS, (best.kind,))
    vetoes = _vetoes(found)
    if best.physics and best.probability >= SURE and not vetoes:
        return Verdict(NAMED if found.adequacy_p > ADEQUATE else NAMED_AND_REST, (best.kind,))
    label_set = _label_set(found.ranking)
    missing = {ranked.kind for ranked in found.ranking if ranked.physics or ranked.kind == UNKNOWN_KIND}
    left = best.physics and UNKNOWN_KIND in label_set and found.adequacy_p <= ADEQUATE
    few = best.physics and 1 < len(label_set) <= MEMBERS and missing.issuperset(label_set)
    if found.paired(found.sure) and found.plain and few and not left and found.gain > 0.0:
        return Verdict(GROUP, label_set, "; ".join(vetoes))
    nameless = left or (best.kind == UNKNOWN_KIND and best.probability >= 0.5)
    if found.paired(found.unknown_sure) and found.strong and nameless:
        if found.unknown_sure > TENFOLD:
            return Verdict(UNKNOWN, (best.kind,) if left else ())
        vetoes = ["a force without a name fits better than a mechanism, but does not predict points that were held out"]
    return Verdict(CANNOT_SAY, label_set, "; ".join(vetoes))


def _vetoes(found: Evidence) -> list[str]:
    vetoes = []
    if not found.plain:
        vetoes.append("the alarm is too weak to claim more")
    if not found.paired(found.sure):
        vetoes.append("so many recorded points contradict those around them that they may be paired wrongly")
    if min(found.gain, found.sure) <= 0.0:
        vetoes.append("points that were held out are not predicted better with it")
    if found.placebo_p > PLACEBO:
        vetoes.append("patterns that mean nothing predict as well")
    if found.size > LARGEST:
        vetoes.append("its size would be implausible")
    if found.needed < SURE:
        vetoes.append("beside nothing, or a force without a name that has to act anyway, it adds little")
    return vetoes


def _label_set(ranking: Sequence[Ranked]) -> tuple[str, ...]:
    """The fewest kinds that are probable enough together."""
    total = np.cumsum([ranked.probability for ranked in ranking])
    count = int(np.searchsorted(total, TOGETHER)) + 1
    return tuple(ranked.kind for ranked in ranking[:count])
