"""`warpbrain cases new` as it is typed."""

import pytest
from command import warpbrain
from shapes import box

from warpbrain.cases.reading import read_case
from warpbrain.mesh import write_mesh


@pytest.fixture
def block(tmp_path):
    write_mesh(tmp_path / "block.vtu", box((3, 3, 3), (0.05, 0.05, 0.05)), unit="mm")
    return tmp_path / "block.vtu"


def test_a_case_from_labels(tmp_path):
    pytest.importorskip("mmgpy")
    pytest.importorskip("nibabel")
    from segmentations import write_ellipsoids

    labels = write_ellipsoids(tmp_path / "seg.nii.gz", (4.0, 4.0, 4.0), (30, 32, 30))
    names = ("--tissue", "2=grey", "4=ventricle", "--others", "white")
    ran = warpbrain("cases", "new", tmp_path / "case", "--labels", labels, *names, "--size", 18)
    assert (ran.status, ran.err) == (0, "")
    assert ran.out.startswith(f"reading {labels}\n")
    assert "tissue 3   white matter: " in ran.out
    assert set(read_case(tmp_path / "case").tissues) == {2, 3}


def test_a_case_from_a_mesh_checks_and_runs(tmp_path, block):
    ran = warpbrain("cases", "new", tmp_path / "case", "--mesh", block, "--units", "mm", "--axes", "RAS")
    assert (ran.status, ran.err) == (0, "")
    assert "node sets surface 56, base 16" in ran.out
    assert warpbrain("cases", "check", tmp_path / "case").status == 0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((), "one of the arguments --labels --mesh is required"),
        (("--labels", "a.nii", "--mesh", "b.vtu"), "not allowed with argument --labels"),
        (("--labels", "a.nii", "--units", "mm"), "--units means nothing with --labels"),
        (("--mesh", "b.vtu", "--size", "5"), "--size means nothing with --mesh"),
        (("--labels", "a.nii", "--size", "big"), "invalid float value: 'big'"),
        (("--labels", "a.nii", "--tissue", "grey"), "expected LABEL=NAME pairs such as 2=grey,3=white, found 'grey'"),
        (("--labels", "none.nii"), "none.nii: no such file"),
        (("--mesh", "none.vtu"), "none.vtu: no such file"),
        (("--mesh", "none.vtu", "--axes", "ASL"), "invalid choice: 'ASL'"),
    ],
)
def test_arguments_that_make_no_case(tmp_path, arguments, message):
    pytest.importorskip("nibabel")
    pytest.importorskip("mmgpy")
    ran = warpbrain("cases", "new", tmp_path / "case", *arguments)
    assert (ran.status, ran.out.replace("reading none.nii\n", "")) == (2, "")
    assert message in ran.err and ran.err.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_a_folder_that_is_not_empty(tmp_path, block):
    ran = warpbrain("cases", "new", tmp_path, "--mesh", block)
    assert ran.status == 2
    assert "there is a folder of that name that is not empty" in ran.err
    assert list(tmp_path.iterdir()) == [block]


def test_a_case_that_is_there_is_overwritten_only_if_that_is_asked_for(tmp_path, block):
    """Its case.toml is kept, and recordings stay."""
    case = tmp_path / "case"
    assert warpbrain("cases", "new", case, "--mesh", block).status == 0
    (case / "case.toml").write_text("mine")
    (case / "recordings" / "beads.csv").write_text("x,y,z\n")
    ran = warpbrain("cases", "new", case, "--mesh", block)
    assert ran.status == 2
    assert ran.err == f"warpbrain: error: {case}: has a case already: choose another folder, or --overwrite it\n"
    assert (case / "case.toml").read_text() == "mine"
    assert warpbrain("cases", "new", case, "--mesh", block, "--overwrite").status == 0
    assert set(read_case(case).tissues) == {1}
    assert (case / "case.toml.old").read_text() == "mine"
    assert (case / "recordings" / "beads.csv").read_text() == "x,y,z\n"
    # what is no case is never replaced
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "notes.txt").write_text("mine")
    assert warpbrain("cases", "new", tmp_path / "mine", "--mesh", block, "--overwrite").status == 2
