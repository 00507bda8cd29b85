"""How a command ends: one line and an exit status, whatever went wrong."""

from __future__ import annotations

import argparse
import os
import signal
import sys
import traceback
from collections.abc import Callable
from typing import NoReturn

from warpbrain.errors import InputError, SolveError
from warpbrain.terminal.crash import SOFTWARE, where, write_report
from warpbrain.terminal.interrupt import clear_up, leave_compiler, stop_promptly
from warpbrain.terminal.quiet import reason_of
from warpbrain.terminal.record import Record
from warpbrain.terminal.result_folder import release


class OneLineParser(argparse.ArgumentParser):
    """A parser whose errors are one line, without the usage before it; ``--help`` tells the usage."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"{self.prog}: error: {message} (see {self.prog} --help)\n")


def exit_status(program: str, call: Callable[[], None], record: Record | None = None, debug: bool = False) -> int:
    """Run a command: 0 done, 1 no answer found or no place to write it, 2 bad input, 70 a defect, 130 interrupted, 141
    nobody reads the output.

    What the record was asked for and said last stand in the report of a defect; `debug` shows the traceback of whatever
    went wrong.
    """
    try:
        with stop_promptly():
            try:
                call()
            except Exception:
                if debug:
                    traceback.print_exc()
                raise
            finally:
                release()
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
        print(f"{program}: {error.filename or 'output'}: {reason_of(error)}", file=sys.stderr)
        return 1
    except MemoryError as error:
        detail = " ".join(str(error).split())
        print(f"{program}: not enough memory{f': {detail}' if detail else ''}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        clear_up()
        print(f"\n{program}: interrupted; nothing half-written was left", file=sys.stderr)
        leave_compiler()
        return 130
    except Exception as error:
        arguments, doing = ((), "") if record is None else (record.arguments, record.doing)
        path = write_report(error, arguments, doing)
        saved = "its report could not be saved" if path is None else f"please send {path} to its developers"
        print(
            f"{program}: a defect of {program}, not of your files: {type(error).__name__} in {where(error)}"
            + (f", after '{doing}'" if doing else "")
            + f": {saved}; --debug shows the traceback",
            file=sys.stderr,
        )
        return SOFTWARE
    return 0
