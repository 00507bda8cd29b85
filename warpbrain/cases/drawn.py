"""Laws of a case's tissues from the generative model: a draw of its prior, or the middle of it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from warpbrain.cases.case import Case
from warpbrain.errors import InputError, SolveError, require_kind
from warpbrain.gp.process import Process
from warpbrain.gp.sampling import DrawnLaws, draw_laws, law_of_curve
from warpbrain.gp.trained import trained


@dataclass(frozen=True)
class FromPrior:
    """Which laws of a case are the generative model's."""

    case: Case  # with these laws
    model: Process
    labels: tuple[int, ...]  # tissues whose laws they are
    #: With one law for each of these tissues; None if the laws are those of the middle curves.
    drawn: DrawnLaws | None = None


def with_prior_draw(case: Case, number: int, seed: int = 0, model: Process | None = None) -> FromPrior:
    """The case with the laws of all tissues from draw `number` of their joint prior, each of its own kind.

    Parameters
    ----------
    case : Case
        Whose tissues say `prior`; `Case.with_law` changes the kind of law first. Tissues of one group share one curve.
    number, seed : int
        Which draw.
    model : Process, optional
        The one that is the default unless given.

    Raises
    ------
    InputError
        With file, tissue and key, if a tissue has no group, or one that the model has seen no study of.
    SolveError
        If no stable law is found.

    Examples
    --------
    >>> from warpbrain.cases.shipped import find_case
    >>> found = with_prior_draw(find_case("0529"), 7)
    >>> found.drawn.groups
    ('hyperelastic/grey matter', 'hyperelastic/white matter')
    """
    require_kind(case, Case, "case", "a Case, as warpbrain.find_case gives")
    asked = trained() if model is None else model
    labels = tuple(sorted(case.tissues))
    require_groups(case, labels, asked)
    tissues = [case.tissues[label] for label in labels]
    try:
        drawn = draw_laws(
            asked,
            [tissue.prior for tissue in tissues],
            [tissue.model for tissue in tissues],
            number,
            seed,
            case.poisson,
            [tissue.formulation for tissue in tissues],
        )
    except SolveError as error:
        raise SolveError(f"{case.path}: {error}") from None
    laws = dict(zip(labels, drawn.laws, strict=True))
    changed = {label: replace(tissue, law=laws[label]) for label, tissue in case.tissues.items()}
    return FromPrior(replace(case, tissues=changed), asked, labels, drawn)


def with_prior_middle(case: Case, model: Process | None = None) -> FromPrior:
    """The case with the laws of tissues that say `mu = "prior"` from the middle curves of their groups.

    `InputError`: with file, tissue and key, if the model has seen no study of a group.
    """
    asked = trained() if model is None else model
    labels = tuple(label for label, tissue in sorted(case.tissues.items()) if tissue.law is None)
    require_groups(case, labels, asked)
    changed = dict(case.tissues)
    for label in labels:
        tissue = changed[label]
        changed[label] = replace(tissue, law=law_of_curve(asked, tissue.prior, law=tissue.model).law())
    return FromPrior(replace(case, tissues=changed), asked, labels)


def require_groups(case: Case, labels: Sequence[int], model: Process) -> None:
    """`InputError` with file, tissue and key, if a tissue has no group, or one that the model has seen no study of."""
    for label in labels:
        group = case.tissues[label].prior
        if group not in model.groups:
            message = f"the generative model '{model.name}' ({model.variant}) has seen no study of '{group}'"
            raise InputError(
                f"{case.path}: [tissue.{label}] prior: {message if group else 'missing, but a draw is of a group'}: "
                f"expected one of {', '.join(model.groups)}"
            )
