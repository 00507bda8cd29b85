"""From the bytes of a `case.toml` to tables, and from names in it to files of its folder."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

from warpbrain.problems import Problems

#: No case.toml is as large as this [bytes]; a file that is must be something else.
LARGEST_TOML = 4 << 20


def parse_toml(file: Path, problems: Problems) -> dict[str, Any] | None:
    """The tables of a file; None if it cannot be read, which is then a problem."""
    try:
        size = file.stat().st_size
        if file.is_file() and size > LARGEST_TOML:
            problems.add(file, "", f"found {size / 1e6:.0f} MB, expected a text of at most {LARGEST_TOML / 1e6:.0f} MB")
            return None
        content = file.read_bytes()
        if not content.strip():
            problems.add(file, "", "the file is empty", "`warpbrain cases new` writes one to start from")
            return None
        # some editors begin UTF-8 text with a byte order mark
        return tomllib.loads(content.decode("utf-8").lstrip("\ufeff"))
    except FileNotFoundError:
        problems.add(file, "", "no such file")
    except OSError as error:
        problems.add(file, "", f"cannot be read: {error.strerror}")
    except UnicodeDecodeError as error:
        problems.add(file, "", f"not UTF-8 text (byte {error.start})", "save it as UTF-8")
    except (ValueError, RecursionError) as error:  # numbers of thousands of digits, thousands of brackets
        problems.add(file, "", f"not valid TOML: {error}")
    return None


def file_of(folder: Path, name: str) -> tuple[Path | None, str]:
    """The file that a case names: its path and no fault, or no path and what is wrong."""
    path = folder / name
    try:
        if not path.resolve().is_relative_to(folder.resolve()):
            return None, f"'{name}' leaves the case folder"
        if not path.exists():
            return None, f"no such file: {path}"
        if not path.is_file():
            return None, f"no such file: {path} is {'a folder' if path.is_dir() else 'not a plain file'}"
    except (OSError, ValueError, RuntimeError) as error:  # a name too long, a link to itself
        return None, f"no such file: {path} ({error})"
    return path, ""
