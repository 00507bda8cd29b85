"""How a command ends: one line and an exit status, whatever went wrong."""

from __future__ import annotations

import argparse
import os
import signal
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
        0 done, 1 no answer found or no place to write it, 2 bad input, 130 interrupted, 141 nobody reads the output.
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
        # whoever read our output left before the work was done: end as the shell's own tools do
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 128 + signal.SIGPIPE
    except OSError as error:
        print(f"{program}: {error.filename or 'output'}: {error.strerror or error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        clear_up()
        print(f"\n{program}: interrupted; nothing half-written was left", file=sys.stderr)
        return 130
    return 0
