"""The verdict of a diagnosis, of a body as of a specimen: what all results have, and its sentences."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from warpbrain.arrays import Floats
from warpbrain.cases.case import Case
from warpbrain.inference.beliefs import belief
from warpbrain.inference.calibration import percent
from warpbrain.inference.causes import Kind
from warpbrain.inference.decide import CANNOT_SAY, NAMED_AND_REST, NOT_PHYSICS, NOTHING, UNKNOWN, Confirmation, Decision
from warpbrain.physics.sizes import smallest_in_words
from warpbrain.physics.words import Measurement, Smallest, Value
from warpbrain.shown import Shown


@dataclass(frozen=True, eq=False)
class Ranked:
    """A cause with its probability, size and place."""

    kind: str
    physics: bool  # whether it is a mechanism, not something that is no physics
    log_evidence: float  # of the cause alone against nothing
    probability: float  # that it acts, whatever else does
    #: `d` of its fitted effect: its length in standard deviations of noise and nuisances.
    detectability: float | None
    #: Of held-out points [m] or rows of tests [Pa] against the refitted case without it; negative is better. None where
    #: it was not fitted.
    heldout_rmse_change: float | None
    values: tuple[Value, ...]  # its parameters
    #: Where it acts, if somewhere: (3,) and a radius [m].
    centre: Floats | None = None
    radius: float | None = None
    region: str = ""  # or in which way
    rejected_because: str = ""
    sentence: str = ""  # what it is, of what is no mechanism of a run


@dataclass(frozen=True)
class Combination:
    """A set of causes."""

    causes: tuple[str, ...]
    kinds: tuple[Kind, ...]  # of each
    log_evidence: float
    log_prior: float
    probability: float
    fitted: bool  # whether it was fitted without linearising
    gross_errors: int = 0  # points that are more probably gross errors than not under it


@dataclass(frozen=True, kw_only=True, eq=False)
class Verdict(Shown):
    """What was left out of a case.

    Attributes
    ----------
    case : Case
    decision : Decision
        After the checks; `by_posterior` before them.
    doubts : tuple of str
        Checks that failed, in words.
    p_value, alpha : float
        Of the hypothesis that nothing is missing; a claim is significant up to `alpha`.
    p_left : float or None
        Of the hypothesis that nothing else is missing; None if nothing is named.
    named : tuple of Ranked
        What is named, the most probable first, as it is in the joint fit.
    ranking : tuple of Ranked
    rejected : dict of str to str
        Causes that were not looked for, and why.
    combinations : tuple of Combination
        Sets of causes, the most probable first.
    next_measurement : tuple of Measurement
    smallest : dict of str to Smallest
    confirmations : tuple of Confirmation
        Of each mechanism of the best set.
    explained : Case or None
        The case with what was named, ready to run.
    assumptions, remarks : tuple of str
    seconds : dict of str to float
    """

    case: Case
    decision: Decision
    by_posterior: Decision
    doubts: tuple[str, ...]
    p_value: float
    alpha: float
    p_left: float | None
    named: tuple[Ranked, ...]
    ranking: tuple[Ranked, ...]
    rejected: Mapping[str, str]
    combinations: tuple[Combination, ...]
    next_measurement: tuple[Measurement, ...]
    smallest: Mapping[str, Smallest]
    confirmations: tuple[Confirmation, ...]
    explained: Case | None
    assumptions: tuple[str, ...]
    remarks: tuple[str, ...]
    seconds: Mapping[str, float]

    @property
    def verdict(self) -> str:
        """One of `warpbrain.inference.decide.VERDICTS`."""
        return self.decision.verdict

    @property
    def group(self) -> tuple[str, ...]:
        """Causes that the data do not discriminate; possible ones if nothing can be said."""
        return () if self.named else self.decision.causes


@dataclass(frozen=True)
class Words:
    """What the sentences of a verdict are put together from, beside its numbers."""

    data: str  # what was recorded: "these data"
    nothing: str  # what would have been seen, where nothing was looked for
    unnamed: str  # what fits better than all that has a name
    named: Sequence[str]  # sentences of what is named
    grounds: str  # a sentence: why
    members: Sequence[tuple[str, float]]  # sentence and probability of each cause of the verdict that has a name
    perhaps: Sequence[str]  # clauses of what may act, where nothing can be said
    only_physics: bool = True  # whether an error of registration, mesh, loads or the like is unlikely
    rest: str = ""  # what is known of what has no name: a sentence after a space


def verdict_in_words(diagnosis: Verdict, words: Words) -> str:
    """The verdict for people, with its doubts: whole sentences."""
    return " ".join([_without_doubts(diagnosis, words), *diagnosis.doubts])


def _without_doubts(diagnosis: Verdict, words: Words) -> str:
    decision, p, data = diagnosis.decision, f"p = {diagnosis.p_value:.2g}", words.data
    verdict = decision.verdict
    if verdict == NOTHING:
        seen = "; ".join(f"{name} {smallest_in_words(name, size)}" for name, size in diagnosis.smallest.items())
        contradicted = f", although {data} contradict that nothing is missing"
        but = contradicted if diagnosis.p_value <= diagnosis.alpha else ""
        return f"No missing physics is detected{but} ({p}). What {data} would have shown: {seen or words.nothing}."
    if decision.named:
        first, *others = words.named
        sentences = [first, *(f"Beside it: {_lower(sentence)}" for sentence in others), words.grounds]
        is_left = "is" if diagnosis.p_left is not None and diagnosis.p_left <= diagnosis.alpha else "may be"
        rest = f" Something else {is_left} left, which this does not explain.{words.rest}"
        return f"{' '.join(sentences)}{rest if verdict == NAMED_AND_REST else ''}"
    if verdict == NOT_PHYSICS:
        errors = " ".join(sentence for sentence, _ in words.members)
        hedge, chance = "", ""
        physics_acts = sum(each.probability for each in diagnosis.combinations if set(each.kinds) - {Kind.NOT_PHYSICS})
        if physics_acts > belief("checks.perhaps"):
            hedge = f", as far as {data} tell"
            chance = f"; that physics is missing beside it has a probability of {percent(physics_acts)}"
        return f"It is not physics that is missing{hedge} ({p}). {errors} That explains the mismatch better{chance}."
    if verdict == UNKNOWN:
        return (
            f"Something is missing ({p}) that none of the known mechanisms explains: {words.unnamed} fits better than "
            f"all of them.{words.rest}"
        )
    if verdict == CANNOT_SAY:
        perhaps = f" Perhaps: {'; or '.join(words.perhaps)}." if words.perhaps else ""
        missing = "missing" if words.only_physics else "wrong or missing"
        nothing_acts = sum(each.probability for each in diagnosis.combinations if not each.causes)
        if diagnosis.p_value > diagnosis.alpha:
            # such a p-value is no reason to say that something is missing: the posterior is
            return (
                f"Something may be {missing}, but {data} cannot say what. The posterior probability that nothing is "
                f"{missing} is {percent(nothing_acts)}, yet {data} do not contradict it ({p}).{perhaps}"
            )
        surely = "may be" if nothing_acts > belief("checks.perhaps") else "is"
        return f"Something {surely} {missing} ({p}), but {data} cannot say what.{perhaps}"
    which = "; or ".join(f"{clause(sentence)} ({percent(probability)})" for sentence, probability in words.members)
    other = "; or something without a name" if UNKNOWN in decision.causes else ""
    return f"Something is missing ({p}), and {data} do not tell which of these it is: {which}{other}."


def grounds(probabilities: Sequence[float], held_out: str, errors: tuple[str, str] | None) -> str:
    """How probable causes are, and how well what was held out is predicted with them and without, if that is known."""
    chances = " and ".join(map(percent, probabilities))
    probable, it = ("Its probability is", "it") if len(probabilities) == 1 else ("Their probabilities are", "them")
    if errors is None:
        return f"{probable} {chances}."
    after, before = errors
    predicted = f"{held_out} that were held out are predicted to {after} with {it}, to {before} without {it}"
    return f"{probable} {chances}; {predicted}."


def clause(sentence: str) -> str:
    """A sentence as a clause."""
    return _lower(sentence).rstrip(".")


def _lower(sentence: str) -> str:
    return f"{sentence[0].lower()}{sentence[1:]}"
