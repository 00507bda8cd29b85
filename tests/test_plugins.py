"""A package of its own beside this one: what it names by entry points is read, run and refused as what is here."""

import os
import re
import shutil
import subprocess
import sys
import tomllib
from importlib.metadata import EntryPoint, EntryPoints
from pathlib import Path

import numpy as np
import pytest
from folders import SIDE, write_folder

from warpbrain import plugins
from warpbrain.errors import InputError
from warpbrain.frame import Frame
from warpbrain.physics.mechanisms import mechanisms
from warpbrain.plugins import added_by_packages
from warpbrain.problems import Problems, Unreadable
from warpbrain.recordings import tracked_points
from warpbrain.recordings.recording import TrackedPoints

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "examples" / "package"
SPEED, DENSITY, MOVED = 40.0, 1040.0, np.array([0.1, 0.0, -0.2])
ADDED = f"""
[[mechanism]]
kind = "turning"
speed = {SPEED}

[[recording]]
name = "saved"
kind = "points"
file = "saved.npz"
sigma = 0.1
"""
#: Total force of a block of side a whose corner is the origin: rho omega^2 a^3 (a/2, a/2, 0).
RUN = """
import numpy as np
import warpbrain as wb
case = wb.read_case("case")
assert type(case.tissues[1].law) is wb.laws["gel"]
recording = case.recordings[-1]
np.savetxt("recorded.txt", np.hstack([recording.points, recording.displacement]))
loaded = wb.model_of(case).external_forces().sum(axis=0)
case = wb.read_case("still")
np.savetxt("force.txt", loaded - wb.model_of(case).external_forces().sum(axis=0))
"""


#: A law that differs from what is here in its name and key alone.
LAW = """
from warpbrain.physics.laws import LawKey, NeoHookean
class Gel(NeoHookean):
    name = "gel"
    keys = {"mu": LawKey("Shear modulus of the gel.")}
"""


def install(folder: Path) -> None:
    """The example as `pip install --target` lays it out, and a law beside it."""
    (folder / "gel.py").write_text(LAW)
    shutil.copy(PACKAGE / "turning_heads.py", folder)
    project = tomllib.loads((PACKAGE / "pyproject.toml").read_text())["project"]
    info = folder / f"turning_heads-{project['version']}.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n")
    groups = [*project["entry-points"].items(), ("warpbrain.laws", {"gel": "gel:Gel"})]
    lines = [
        f"[{group}]\n" + "".join(f"{name} = {value}\n" for name, value in names.items()) for group, names in groups
    ]
    (info / "entry_points.txt").write_text("\n".join(lines))


def test_the_example_is_of_sixty_lines():
    assert sum(len(file.read_text().splitlines()) for file in PACKAGE.iterdir() if file.is_file()) <= 60


def test_a_mechanism_a_law_and_a_reader_of_another_package(tmp_path):
    installed = tmp_path / "site"
    installed.mkdir()
    install(installed)
    write_folder(tmp_path / "still")
    case = write_folder(tmp_path / "case", ('model = "neo-hookean"', 'model = "gel"'))
    (case / "case.toml").write_text((case / "case.toml").read_text() + ADDED)
    before = np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])
    np.savez(case / "saved.npz", before=before, after=before + MOVED)
    variables = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), str(installed)])}
    command = [sys.executable, "-c", RUN]
    done = subprocess.run(command, cwd=tmp_path, env=variables, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    recorded = np.loadtxt(tmp_path / "recorded.txt")
    np.testing.assert_allclose(recorded, np.hstack([before, [MOVED] * 2]) * 1e-3, atol=1e-15)
    force = DENSITY * SPEED**2 * SIDE**3 * np.array([0.5, 0.5, 0.0]) * SIDE
    np.testing.assert_allclose(np.loadtxt(tmp_path / "force.txt"), force, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("gravity", "os:path", "'gravity' of warpbrain.mechanisms: the name is taken"),
        ("turning", "no_such_module:Turning", "cannot load no_such_module:Turning: ModuleNotFoundError"),
        ("turning", "os:Turning", "cannot load os:Turning: AttributeError"),
    ],
)
def test_what_cannot_be_added_names_its_package(monkeypatch, name, value, expected):
    point = EntryPoint(name, value, "warpbrain.mechanisms")
    monkeypatch.setattr(plugins, "entry_points", lambda group: EntryPoints([point]).select(group=group))
    with pytest.raises(InputError, match=r"^a package: entry point") as error:
        added_by_packages("mechanisms", mechanisms())
    assert expected in str(error.value)


@pytest.mark.parametrize(
    ("read", "message"),
    [
        ({"points": np.zeros((0, 3)), "displacement": np.zeros((0, 3))}, "found no points"),
        ({"displacement": np.zeros((3, 3))}, r"displacement: expected finite numbers of shape \(2, 3\)"),
        ({"displacement": np.full((2, 3), np.nan)}, "displacement: expected finite numbers"),
        ({"time": np.zeros(3)}, r"time: expected finite numbers of shape \(2,\), found \(3,\)"),
        ({"ids": ("a",)}, "ids: expected one for each of 2 points, found 1"),
        ({"ids": ("a", "a")}, "found an id twice"),
    ],
)
def test_what_a_reader_gets_wrong_is_told_of_its_file(tmp_path, monkeypatch, read, message):
    path, problems = tmp_path / "points.xyz", Problems()
    path.write_text("x")
    sound = {"points": np.zeros((2, 3)), "displacement": np.zeros((2, 3))}
    monkeypatch.setattr(
        tracked_points, "added_readers", lambda: {".xyz": lambda path: TrackedPoints(**{**sound, **read})}
    )
    with pytest.raises(Unreadable):
        tracked_points.tracked_points(path, Frame("mm", "RAS"), None, problems)
    [problem] = problems.found
    assert problem.file == path and re.match(message, problem.message)
