"""`warpbrain run --with`: mechanisms said in one line."""

import json

import pytest
from command import run
from folders import write_folder


def largest(out):
    return json.loads((out / "summary.json").read_text())["result"]["displacement_mm"]["top"]["largest"]


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    """Largest displacement of the block with nothing added [mm]."""
    out = tmp_path_factory.mktemp("plain")
    assert run(write_folder(out / "case"), "--out", out / "out").status == 0
    return largest(out / "out")


@pytest.mark.parametrize(
    "said",
    [
        "swelling:amount=5",
        "pressure:nodes=top,value=40",
        "inclusion:ratio=4,centre=5/5/5,radius=4",
        "fibres:direction=1/0/0,stiffness=20000",
        "residual-stress:tension=100,direction=0/0/1",
        "compressibility:poisson=0.3",
        "asymmetry:exponent=-8",
        "traction:centre=15/15/30,value=0/0/-20,radius=15",
        "contact:nodes=top",
    ],
)
def test_each_changes_what_happens(tmp_path, plain, said):
    done = run(write_folder(tmp_path / "case"), "--with", said, "--out", tmp_path / "with")
    assert done.status == 0, done.err
    kind = said.split(":")[0]
    assert abs(largest(tmp_path / "with") - plain) > 1e-4, kind


def test_what_takes_the_place_of_the_cases_own_is_said(tmp_path):
    case = write_folder(tmp_path / "case")
    with (case / "case.toml").open("a", encoding="utf-8") as stream:
        stream.write('[[mechanism]]\nkind = "gravity"\ncsf_level = 10.0\ndirection = [0, 0, -1]\n')
    said = "gravity:level=20,direction=0/0/-1"
    done = run(case, "--with", said, "--out", tmp_path / "out")
    assert done.status == 0 and f"  remark    in place of its gravity: {said}\n" in done.out, done.err
    assert json.loads((tmp_path / "out" / "summary.json").read_text())["case"]["remarks"] == [
        f"in place of its gravity: {said}"
    ]
    twice = run(case, "--with", said, "--with", "gravity:direction=0/0/-1", "--out", tmp_path / "twice")
    assert twice.status == 2 and f"--with gravity:direction=0/0/-1: a second gravity, beside {said}" in twice.err


@pytest.mark.parametrize("said", ["pressure:nodes=bottom,value=40", "traction:nodes=bottom,force=0/0/1"])
def test_a_load_on_what_is_held_is_said(tmp_path, said):
    done = run(write_folder(tmp_path / "case"), "--with", said, "--out", tmp_path / "out")
    assert (
        f"  remark    {said.partition(':')[0]} does nothing on all of 'bottom', which a [[boundary]] fixes" in done.out
    )


def test_what_is_assumed_is_not_said_to_be_left_out(tmp_path):
    case = write_folder(tmp_path / "case")
    for number, said in enumerate(("swelling:amount=5", "contact:nodes=top")):
        out = tmp_path / str(number)
        assert run(case, "--with", said, "--out", out).status == 0
        absent, *_ = json.loads((out / "summary.json").read_text())["case"]["left_out"]
        assert absent.startswith("not assumed: ") and "viscosity" in absent
        assert ("contact with the skull" in absent) == (said[:7] != "contact")


@pytest.mark.parametrize(
    ("said", "expected"),
    [
        ("swelling", "swelling: amount is missing [%]"),
        ("sweling:amount=3", "no mechanism 'sweling': did you mean 'swelling'?"),
        ("swelling:amount=much", "amount: found 'much', expected a number [%]"),
        ("swelling:amount=-95", "amount: found -95, expected a number in the open interval (-90, 400) [%]"),
        ("pressure:nodes=top,value=inf", "value: expected a finite number [Pa], found inf"),
        ("drainage:permeability=0", "permeability: found 0, expected a positive number"),
        ("contact:nodes=top,friction=-1", "friction: found -1, expected a number of at least 0"),
        ("swelling:size=3", "no key 'size' of swelling: expected one of amount, elements, centre, radius"),
        ("swelling:amount=3,radius=5", "centre: missing: a ball has a centre and a radius"),
        ("swelling:amount=3,amount=4", "each key once"),
        ("pressure:nodes=nothing,value=3", "nodes: the mesh has no node set 'nothing'"),
        ("traction:centre=1/2,value=0/0/1", "centre: found '1/2', expected three numbers joined by /"),
        ("contact:nodes=top,state=glued", "state: found 'glued', expected one of fixed, sliding, lifting"),
        ("viscoelasticity:moduli=1/2,times=1", "times: found 1, and 2 of moduli"),
    ],
)
def test_what_makes_no_sense_is_told(tmp_path, said, expected):
    done = run(write_folder(tmp_path / "case"), "--with", said, "--out", tmp_path / "out")
    assert done.status == 2 and expected in done.err, done.err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("said", "expected"),
    [
        (
            ("cavity:elements=corner", "pressure:nodes=top,value=3"),
            "cavity and pressure cannot act together: pressure acts on tissue of the element set 'corner'",
        ),
        (
            ("drainage:permeability=1e-9", "cavity:elements=corner"),
            "cavity and drainage cannot act together: drainage acts on tissue of the element set 'corner'",
        ),
        (
            ("resection:elements=corner", "inclusion:ratio=3,elements=corner"),
            "resection and inclusion cannot act together: in the tissue that is left the element set 'corner' is empty",
        ),
    ],
)
def test_what_has_no_meaning_together_is_refused(tmp_path, said, expected):
    given = [word for one in said for word in ("--with", one)]
    done = run(write_folder(tmp_path / "case"), *given, "--out", tmp_path / "out")
    assert done.status == 2 and expected in done.err and said[1] in done.err, done.err
    assert not (tmp_path / "out").exists()


def test_a_case_of_what_has_no_meaning_together_is_refused(tmp_path):
    folder = write_folder(tmp_path / "case")
    with (folder / "case.toml").open("a", encoding="utf-8") as stream:
        stream.write('[[mechanism]]\nkind = "cavity"\nelements = "corner"\n')
        stream.write('[[mechanism]]\nkind = "drainage"\npermeability = 1e-9\n')
    done = run(folder, "--out", tmp_path / "out")
    assert done.status == 2 and "cavity and drainage cannot act together: drainage acts on" in done.err, done.err


def test_a_boundary_is_refused_too(tmp_path):
    """A face that is pressed, as a boundary says it, is a pressure."""
    pressed = ('kind = "force"\ntotal = [0.01, 0.02, -0.05]', 'kind = "pressure"\nvalue = 10.0')
    done = run(write_folder(tmp_path / "case", pressed), "--with", "cavity:elements=corner", "--out", tmp_path / "out")
    assert done.status == 2 and "cavity and pressure cannot act together" in done.err, done.err


def test_elements_that_do_not_lock_move_more(tmp_path):
    folder = write_folder(tmp_path / "case")
    stiff = ("--poisson", "0.49")
    for elements in ("tet4", "tet4-averaged", "tet10"):
        done = run(folder, *stiff, "--elements", elements, "--out", tmp_path / elements)
        assert done.status == 0, done.err
        assert ("stiffer on linear tetrahedra" in done.out) == (elements == "tet4")
    assert largest(tmp_path / "tet4-averaged") > 1.05 * largest(tmp_path / "tet4")
    assert largest(tmp_path / "tet10") > 1.05 * largest(tmp_path / "tet4")


@pytest.mark.parametrize(
    ("asked", "elements", "expected"),
    [
        ((), "tet10-mixed", "elements  tet10-mixed: nu = 0.495 is above 0.49, where tet4 and tet10 lock"),
        (
            ("--with", "viscoelasticity:moduli=1000,times=1"),
            "tet4-averaged",
            "viscoelasticity cannot act on tet10-mixed, which do not lock",
        ),
        (("--mesh-error",), "tet4-averaged", "not tet10-mixed because of --mesh-error"),
        (("--mesh-error", "elements"), "tet4", "stiffer on linear tetrahedra than it is: at nu = 0.49 a"),
        (("--elements", "tet10"), "tet10", "stiffer on elements tet10 than it is: at nu = 0.49 a"),
    ],
)
def test_nearly_incompressible_tissue_has_elements_that_do_not_lock(tmp_path, asked, elements, expected):
    """If nobody asks for others; then they say by how much they lock."""
    out = tmp_path / "out"
    done = run(write_folder(tmp_path / "case"), "--poisson", "0.495", *asked, "--out", out)
    assert done.status == 0, done.err
    assert expected in done.out
    case = json.loads((out / "summary.json").read_text(encoding="utf-8"))["case"]
    assert case["elements"] == elements
    assert (case["elements_chosen"] == "asked for") == ("--elements" in asked)
    assert (case["elements_chosen"] in done.out) == (elements in ("tet10-mixed", "tet4-averaged"))


def test_what_knows_no_midside_nodes_is_refused(tmp_path):
    said = ("--with", "viscoelasticity:moduli=1000,times=1", "--elements", "tet10")
    done = run(write_folder(tmp_path / "case"), *said, "--out", tmp_path / "out")
    assert done.status == 2 and "viscoelasticity: cannot act on elements 'tet10'" in done.err, done.err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("elements", ["tet10", "tet10-mixed"])
def test_the_error_of_quadratic_elements_is_not_known(tmp_path, elements):
    said = ("--mesh-error", "--elements", elements, "--out", tmp_path / "out")
    done = run(write_folder(tmp_path / "case"), *said)
    assert done.status == 2 and f"--mesh-error: is not known of --elements {elements}" in done.err, done.err
