"""How a command ends: one line and an exit status, whatever went wrong; a defect leaves a report with what a developer
needs and nothing of a user's data."""

import argparse
import os
import platform
import shlex
import signal
import sys
import tempfile
import traceback
from collections.abc import Callable, Sequence
from contextlib import suppress
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import NoReturn

from warpbrain import __version__
from warpbrain.errors import InputError, SolveError
from warpbrain.terminal.interrupt import clear_up, leave_threads, stop_promptly
from warpbrain.terminal.quiet import reason_of
from warpbrain.terminal.record import Record
from warpbrain.terminal.result_folder import release

#: Exit status of a defect: EX__SOFTWARE of `sysexits.h`.
_SOFTWARE = 70
#: Characters of a line of a report: a message of an exception may hold what an array holds.
_WIDTH = 200
_PACKAGES = ("warp-lang", "numpy", "scipy", "meshio", "h5py", "matplotlib", "nibabel", "SimpleITK", "mmgpy", "cupy")


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
        clear_up(program)
        leave_threads()
        # `python -m` ends by the signal itself, whatever status is returned, if the interrupt fell into text that was
        # executed, as dataclasses and Warp do, and no other text has been executed since
        exec("")
        return 130
    except Exception as error:
        arguments, doing = ((), "") if record is None else (record.arguments, record.doing)
        path = _report(error, arguments, doing)
        saved = "its report could not be saved" if path is None else f"please send {path} to its developers"
        print(
            f"{program}: a defect of {program}, not of your files: {type(error).__name__} in {_where(error)}"
            + (f", after '{doing}'" if doing else "")
            + f": {saved}; --debug shows the traceback",
            file=sys.stderr,
        )
        return _SOFTWARE
    return 0


def _report(error: BaseException, arguments: Sequence[str], doing: str) -> Path | None:
    """Write versions, arguments and traceback, no values of variables and no line that is long, to the working folder,
    or to that for temporary files; None if it can be written nowhere. `doing` is what was said last of what is done."""
    versions = {"warpbrain": __version__, "python": platform.python_version(), "platform": platform.platform()}
    for name in _PACKAGES:
        with suppress(PackageNotFoundError):
            versions[name] = version(name)
    lines = [
        "A defect of warpbrain. Please send this file to its developers; look through it first: it holds the command",
        "with its file names, versions and where the program was, and no data.",
        "",
        f"command    {shlex.join(['warpbrain', *arguments])}",
        f"doing      {doing or 'not said'}",
        f"when       {datetime.now(UTC).isoformat(timespec='seconds')}",
        *(f"{name:<10} {text}" for name, text in versions.items()),
        "",
        *"".join(traceback.format_exception(error)).splitlines(),
    ]
    text = "\n".join(line if len(line) <= _WIDTH else f"{line[:_WIDTH]}..." for line in lines) + "\n"
    name = f"warpbrain-crash-{datetime.now(UTC):%Y%m%d-%H%M%S}-{os.getpid()}.txt"
    for folder in (Path.cwd, lambda: Path(tempfile.gettempdir())):
        with suppress(OSError):
            path = folder() / name
            path.write_text(text, encoding="utf-8", errors="replace")
            return path
    return None


def _where(error: BaseException) -> str:
    """The file and line of ours that the exception came through last."""
    for frame in reversed(traceback.extract_tb(error.__traceback__)):
        _, package, place = f"/{Path(frame.filename).as_posix()}".rpartition("/warpbrain/")
        if package:
            return f"{place}, line {frame.lineno}"
    return "outside of warpbrain"
