"""The two kinds of failure that a user can meet, each told in one line."""


class InputError(ValueError):
    """Bad input: the message names the file or argument, what was found and what was expected. Exit status 2."""


class SolveError(RuntimeError):
    """A computation that has no answer or did not find one: the message says at what load, where and why. Status 1."""
