"""Reads what the tool said of a calibration set, and writes the file of all its numbers that are fitted."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

import warpbrain
from referee.decision import decide
from referee.diagnoses import NOT_PHYSICS, UNKNOWN, Tried
from referee.errors import InputError
from referee.intervals import Share, share
from referee.outcomes import Outcome, ScoredSet, read_outcomes
from referee.reliability import reliability
from referee.scores import ALPHA
from referee.sealed import open_labels
from referee.temperature import Ballot, Floats, Scale, fit, held_out, interval, log_loss

#: Where the tool reads it.
FILE = Path(warpbrain.__file__).parent / "inference" / "calibration.json"
#: Fewest cases that a scale is fitted to.
FEWEST = 10
#: What a false name may cost, and the share of spoken names that may be wrong. At the least price a name that is left
#: out at 0.4 is added to others from a probability of 5/6.
PRICES, WRONG = (2.0, 2.8, 4.0, 5.6, 8.0, 11.0, 16.0, 22.0, 32.0, 45.0, 64.0), 0.03


def calibrate(sets: Sequence[ScoredSet], write: Path = FILE, price_alone: bool = False) -> str:
    """Fit the temperature and the price of a false name, count right names, and write all of it.

    Parameters
    ----------
    sets : sequence of ScoredSet
        Cases without a case folder are left out.
    write : Path
        File that is written.
    price_alone : bool
        Whether the temperature, and how much is said at most, stay what they were of more cases than these.

    Returns
    -------
    str
        What was found, to be read.

    Raises
    ------
    InputError
        If a label or a diagnosis is not one, or there are too few cases whose truth was tried.
    """
    outcomes: list[Outcome] = []
    missing: list[str] = []
    for each in sets:
        opened = open_labels(each.labels, each.commitments)
        diagnosed, silent = read_outcomes(
            {name: opened[name] for name in opened if (each.cases / name).is_dir()}, each.diagnoses
        )
        outcomes, missing = outcomes + diagnosed, missing + silent
    ballots = [Ballot(o.said.hypotheses, np.array([true_of(o, h) for h in o.said.hypotheses])) for o in outcomes]
    useful = [(o, b) for o, b in zip(outcomes, ballots, strict=True) if b.right.any()]
    if len(useful) < FEWEST:
        raise InputError(
            f"{sets[0].diagnoses}: the truth was among the hypotheses in {len(useful)} of {len(outcomes)} cases; "
            f"expected {FEWEST} or more"
        )
    chosen = [b for _, b in useful]
    known = known_of(write)
    scale, ends, apart = fit(chosen), interval(chosen), held_out(chosen)
    # names of cases whose truth was not tried are spoken and false, too
    others = [(o, b) for o, b in zip(outcomes, ballots, strict=True) if not b.right.any()]
    everyone = [*useful, *others]
    if price_alone:
        scale, ends = Scale(known["temperature"]), known["interval"]["temperature"]
        apart = [scale.probabilities(b.hypotheses) for b in chosen]
    probabilities = [*apart, *(scale.probabilities(b.hypotheses) for _, b in others)]
    losses, spoken = priced([o for o, _ in everyone], [b for _, b in everyone], probabilities, known["losses"])
    names = " and ".join(each.cases.resolve().parent.name for each in sets)
    content = {
        "source": f"`python -m referee calibrate`, {len(useful)} cases of {names}"
        if not price_alone
        else f"{known['source']}; the price of a false name: {len(useful)} cases of {names}",
        "date": f"{datetime.now(UTC):%Y-%m-%d}",
        "temperature": round(scale.temperature, 3),
        # by the rule of succession: that all were right does not make the next one certain; in whole percent
        "most_said": known["most_said"] if price_alone else math.floor(100 * (spoken.hits + 1) / (spoken.of + 2)) / 100,
        "losses": losses,
        "interval": {"temperature": np.round(ends, 3).tolist()},
    }
    write.write_text(json.dumps(content, indent=1) + "\n", encoding="ascii")
    kinds = ", ".join(f"{sum(o.kind == kind for o, _ in useful)} {kind}" for kind in _KINDS)
    apart_from = "" if price_alone else " by what the other four fifths give"
    lines = [
        f"{len(outcomes)} cases, {len(missing)} without a diagnosis; fitted to {len(useful)}: {kinds}.",
        f"Left out: {len(outcomes) - len(useful)} whose truth was not among the hypotheses.",
        "",
        f"temperature {scale.temperature:.2f}, {ends[0]:.2f} to {ends[1]:.2f}",
        "",
        f"A false name costs {losses['false name']:g}: names right{apart_from}: {spoken}.",
        *_before_and_after(chosen, apart),
        f"Written: {write.name}",
    ]
    return "\n".join(lines)


_KINDS = ("none", "effect", "two", "outside", "trap")


def true_of(outcome: Outcome, tried: Tried) -> bool:
    """Whether a set of causes is the true one; what is no physics may act beside what is.

    In a trap that may also be noise or gross errors, which every set has.
    """
    if outcome.kind == "trap":
        return not tried.physics and UNKNOWN not in tried.causes
    if tried.physics:
        named = all(map(outcome.right, tried.physics)) and UNKNOWN not in tried.causes
        return named and len(tried.physics) == len(outcome.label["names"])
    return tried.causes == frozenset(_NAMELESS.get(outcome.kind, ("-",)))


_NAMELESS: Mapping[str, tuple[str, ...]] = {"none": (), "outside": (UNKNOWN,)}


def known_of(file: Path) -> dict[str, Any]:
    """A calibration that was written before; that of the package if there is none yet."""
    return dict(json.loads((file if file.exists() else FILE).read_text(encoding="utf-8")))


def priced(
    outcomes: Sequence[Outcome],
    ballots: Sequence[Ballot],
    probabilities: Sequence[Floats],
    losses: Mapping[str, float],
) -> tuple[dict[str, float], Share]:
    """The least price of a false name at which spoken names are right as often as is asked; the highest if none is.

    As often by what is stated of them, and not seldomer, by more than chance, by how often they were: one wrong name of
    fifty that no price takes away must not silence the other ones. What else is false costs what it did. Of fewer names
    than one wrong one among them would show, the price stays what it was.
    """
    for price in PRICES:
        now = {**losses, "false name": price}
        spoken = _spoken(outcomes, ballots, probabilities, now)
        right, stated = share(hit for hit, _ in spoken), [p for _, p in spoken]
        # the least price has the most names
        if price == PRICES[0] and right.of < 1.0 / WRONG:
            return dict(losses), share(hit for hit, _ in _spoken(outcomes, ballots, probabilities, losses))
        if right.of == 0 or (np.mean(stated) >= 1.0 - WRONG and right.interval[1] >= 1.0 - WRONG):
            break
    return now, right


def _spoken(
    outcomes: Sequence[Outcome], ballots: Sequence[Ballot], probabilities: Sequence[Floats], losses: Mapping[str, float]
) -> list[tuple[bool, float]]:
    """Of each verdict with names whether all of these are right, and the probability that they are."""
    spoken = []
    for outcome, ballot, p in zip(outcomes, ballots, probabilities, strict=True):
        if outcome.said.p_value > ALPHA:
            continue
        posterior: dict[frozenset[str], float] = {}
        for one, value in zip(ballot.hypotheses, p.tolist(), strict=True):
            # what is no physics beside what is changes no verdict
            causes = one.causes - {NOT_PHYSICS} if len(one.causes) > 1 else one.causes
            posterior[causes] = posterior.get(causes, 0.0) + value
        said = decide(posterior, losses)
        if said.verdict in ("named", "named + rest"):
            spoken.append((all(map(outcome.right, said.causes)), said.probability))
    return spoken


def _before_and_after(ballots: Sequence[Ballot], apart: Sequence[Floats]) -> list[str]:
    right, one = np.concatenate([b.right for b in ballots]), Scale(1.0)
    plain = [one.probabilities(b.hypotheses) for b in ballots]
    lines = ["", f"mean log loss at a temperature of 1: {log_loss(one, ballots):.3f}; calibration error:"]
    for name, rows in (("at a temperature of 1", plain), ("by the other four fifths", apart)):
        measured: dict[str, Any] = reliability(np.concatenate(rows), right)
        lines.append(f"  {name}: {measured['ece']:.3f}")
        lines += [f"    stated {q:.2f}: right {r:.2f} of {n}" for q, r, n in measured["rows"]]
    return lines
