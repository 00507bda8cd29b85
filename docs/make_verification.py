"""Makes the tables of docs/verification.md, in bench/results: `python docs/make_verification.py [--without-slow]`.

Runs every test that compares with an independent reference and writes what they measured. If one of them fails the file
stays as it was. Without the slow ones their rows are missing, and the file says so.
"""

from __future__ import annotations

import json
import platform
import re
import shutil
import subprocess
import sys
import tempfile
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "tests"))

from verification_page import page  # noqa: E402
from verification_rows import Measurement  # noqa: E402

PAGE = ROOT / "bench" / "results" / "verification.md"
WITHOUT_SLOW = "--without-slow" in sys.argv[1:]
#: What computes, and what it is compared with.
PACKAGES = ("warp-lang", "numpy", "scipy", "felupe", "scikit-fem", "mpmath")


def main() -> int:
    """Run the tests and write the page; returns the exit status of pytest."""
    with tempfile.TemporaryDirectory() as folder:
        rows = Path(folder) / "rows.json"
        which = "verification and not slow" if WITHOUT_SLOW else "verification"
        command = [sys.executable, "-m", "pytest", "-m", which, "--verification-rows", str(rows), "-rs"]
        command += ["-n", "auto", "--dist", "loadfile"]
        status = subprocess.run(command, cwd=ROOT, check=False).returncode
        if status:
            print(f"{PAGE.name} is as it was: not every test passed", file=sys.stderr)
            return status
        measurements = [Measurement(**row) for row in json.loads(rows.read_text(encoding="utf-8"))]
    PAGE.write_text(page(measurements, made()), encoding="utf-8")
    print(f"{len(measurements)} measurements written to {PAGE.relative_to(ROOT)}")
    return 0


def made() -> dict[str, str]:
    """What the figures are made on and with."""
    known = {"Python": platform.python_version()} | {name: _version(name) for name in PACKAGES}
    known["CalculiX"] = _calculix()
    return {
        "machine": f"{_processor()}, {platform.system()}, in double precision unless said",
        "date": f"{datetime.now(UTC):%Y-%m-%d}",
        "commit": _commit(),
        "versions": ", ".join(f"{name} {value}" for name, value in known.items()),
    } | ({"left out": "tests marked slow (`python -m pytest -m 'verification and slow'`)"} if WITHOUT_SLOW else {})


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"


def _calculix() -> str:
    if (program := shutil.which("ccx")) is None:
        return "not installed"
    said = subprocess.run([program, "-v"], capture_output=True, text=True, check=False).stdout
    found = re.search(r"Version (\S+)", said)
    return found[1] if found else "of an unknown version"


def _processor() -> str:
    told = Path("/proc/cpuinfo")
    names = re.findall(r"^model name\s*:\s*(.+)$", told.read_text(encoding="utf-8"), re.M) if told.exists() else []
    return names[0] if names else platform.processor() or platform.machine()


def _commit() -> str:
    def git(*words: str) -> str:
        return subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True, check=True).stdout.strip()

    # the file itself is about to be written
    changed = [line for line in git("status", "--porcelain").splitlines() if not line.endswith(PAGE.name)]
    return git("rev-parse", "--short", "HEAD") + (" with changes" if changed else "")


if __name__ == "__main__":
    sys.exit(main())
