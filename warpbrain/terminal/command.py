"""How a command ends: one line and an exit status, whatever went wrong."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable
from typing import NoReturn

from warpbrain.errors import InputError, SolveError
from warpbrain.terminal.interrupt import clear_up, stop_promptly


class OneLineParser(argparse.ArgumentParser):
    """A parser whose errors are one line, without the usage before it; ``--help`` tells the usage."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"{self.prog}: error: {message} (see {self.prog} --help)\n")


def exit_status(program: str, call: Callable[[], None]) -> int:
    """Run a command.

    Returns
    -------
    int
        0 done, 1 no answer found or no place to write it, 2 bad input, 130 interrupted.
    """
    try:
        with stop_promptly():
            call()
            sys.stdout.flush()
    except InputError as error:
        print(f"{program}: error: {error}", file=sys.stderr)
        return 2
    except SolveError as error:
        print(f"{program}: {error}", file=sys.stderr)
        return 1
    except BrokenPipeError:
        # whoever read our output has enough; what Python still holds has nowhere to go
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except OSError as error:
        print(f"{program}: {error.filename or 'output'}: {error.strerror or error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        clear_up()
        print(f"\n{program}: interrupted; nothing half-written was left", file=sys.stderr)
        return 130
    return 0
