"""What commands say of a case in their log, and of the pictures that a page has."""

from collections.abc import Callable

from warpbrain.cases.case import Case
from warpbrain.report.files import fingerprints
from warpbrain.report.picture import Pictures
from warpbrain.report.summary import machine
from warpbrain.simulation.system import System
from warpbrain.terminal.record import Record


def note_case(record: Record, case: Case, device: str) -> None:
    """Say in the log what is computed of which files, where, and by which versions."""
    record.note(
        case=str(case.path),
        sha256=", ".join(f"{name} {digest}" for name, digest in fingerprints(case).items()),
        device=device,
        versions=", ".join(f"{name} {version}" for name, version in machine().items()),
    )


def note_device(record: Record, case: Case, system: System, precision: str) -> None:
    """Say in the log and in print where is computed."""
    where = f"{system.device.name} ({system.device.alias}), {precision} precision"
    note_case(record, case, where)
    record.say(f"  device    {where}")


def drawn(pictures: Pictures | str, say: Callable[..., None]) -> list[str]:
    """Names of the files that a page and its pictures are in; says why there are no pictures, if there are none."""
    if isinstance(pictures, str):
        say("", f"deformation.png is not drawn: {pictures}")
        return ["report.html"]
    return ["deformation.png", "report.html"]
