"""The two kinds of failure that a user can meet, each told in one line."""


class InputError(ValueError):
    """Bad input: the message names the file or argument, what was found and what was expected. Exit status 2."""


class SolveError(RuntimeError):
    """A computation that has no answer or did not find one: the message says at what load, where and why. Status 1."""


def require_kind(value: object, kind: type | tuple[type, ...], argument: str, expected: str) -> None:
    """Raise an `InputError` that names an argument of the wrong type, and says what is expected.

    Examples
    --------
    >>> require_kind(5, str, "said", "a text")
    Traceback (most recent call last):
        ...
    warpbrain.errors.InputError: said: expected a text, found int
    """
    if not isinstance(value, kind):
        raise InputError(f"{argument}: expected {expected}, found {type(value).__name__}")
