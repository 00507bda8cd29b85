"""A file of a user's: three lines are enough, and whatever is wrong is named with the study, the key and the cure."""

import re
from contextlib import suppress

import numpy as np
import pytest

from warpbrain.errors import InputError
from warpbrain.gp.literature.studies import read_studies
from warpbrain.gp.literature.study import dataset

HEAD = '[[study]]\nname = "Mine 2024"\ngroup = "hyperelastic/brain"\n'


def write(folder, text: str | bytes):
    path = folder / "mine.toml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def added(folder, text: str):
    """The one study that a file adds."""
    *shipped, mine = read_studies(add=write(folder, text))
    assert tuple(shipped) == read_studies()
    return mine


def problems(folder, text: str | bytes) -> list[str]:
    """Everything that is wrong, without the folder's path."""
    path = write(folder, text)
    with pytest.raises(InputError) as error:
        read_studies(add=path)
    found = str(error.value).split("\n")
    return [problem.replace(f"{path}: ", "") for problem in found]


def test_three_lines_add_a_study_and_its_points(tmp_path):
    mine = added(tmp_path, HEAD + "mu = 900.0\n")
    assert (mine.form, mine.tension, mine.stretch, mine.task) == ("neo-hookean", {"mu": 900.0}, (0.6, 1.4), 10)
    assert mine.energy(2.0) == pytest.approx(900.0)
    groups, _, _ = dataset(read_studies(add=tmp_path / "mine.toml"))
    assert np.count_nonzero(groups == 10) == 1600


@pytest.mark.parametrize(
    ("group", "stretch"),
    [
        ("MRE/white matter", (0.95, 1.05)),
        ("linear/abnormal", (0.9, 1.1)),
        ("hyperelastic/grey matter", (0.9, 1.1)),
        ("hyperelastic/abnormal", (0.8, 1.2)),
    ],
)
def test_a_group_gives_the_stretch_and_the_form(tmp_path, group, stretch):
    mine = added(tmp_path, f'[[study]]\nname = "a"\ngroup = "{group}"\nmu = 900')
    assert mine.stretch == stretch
    assert mine.form == ("neo-hookean" if group.startswith("hyper") else "linear")
    assert mine.shear_moduli == (900.0, 900.0)


@pytest.mark.parametrize(
    ("lines", "modulus"),
    [
        ('form = "linear"\nE = 2900\nnu = 0.45', 1000.0),
        ('form = "ogden"\nmu = -400.0\nalpha = -5', 1000.0),
        ('form = "ogden"\nmu = [-400.0]\nalpha = [-5]', 1000.0),
        ('form = "ogden"\nconvention = "budday"\nmu = [700, 300]\nalpha = [-5, 3]', 1000.0),
        ('form = "ogden"\nC = [-250]\nm = [-4]', 1000.0),
        ('form = "mooney-rivlin"\nmu = 1000\nc = 200', 1000.0),
        ('form = "mooney-rivlin"\nconvention = "mihai"\nC1 = 600\nC2 = 400', 1000.0),
        ('form = "demiray"\nmu = 1000\nbeta = 3', 1000.0),
    ],
)
def test_forms_and_conventions(tmp_path, lines, modulus):
    assert added(tmp_path, HEAD + lines).shear_moduli == pytest.approx((modulus, modulus))


def test_units_scale_moduli_and_nothing_else(tmp_path):
    mine = added(tmp_path, 'units = "kPa"\n' + HEAD + 'form = "ogden"\nconvention = "budday"\nmu = 1.61\nalpha = -16.6')
    assert mine.shear_moduli[0] == pytest.approx(1610.0)
    assert mine.tension["alpha"] == (-16.6,)


def test_sides_may_differ(tmp_path):
    mine = added(tmp_path, HEAD + "stretch = [0.8, 1.1]\ncompression = { mu = 990 }\ntension = { mu = 290 }\n")
    assert mine.split and mine.shear_moduli == (990.0, 290.0)
    assert mine.grid()[[0, 49, 50, 99]].tolist() == [0.8, 1.0, 1.0, 1.1]


def test_a_user_may_correct_too(tmp_path):
    path = write(tmp_path, HEAD + 'mu = 900\ncorrected = { mu = 450, reason = "a factor 2" }')
    assert read_studies("as_published", add=path)[-1].shear_moduli[0] == 900.0
    mine = read_studies(add=path)[-1]
    assert (mine.shear_moduli[0], mine.reason) == (450.0, "a factor 2")
    write(tmp_path, HEAD + 'mu = 900\ncorrected = { out = true, reason = "withdrawn" }')
    assert len(read_studies(add=path)) == 72
    assert len(read_studies("as_published", add=path)) == 74


def test_text_is_kept_and_editors_marks_are_not(tmp_path):
    text = "\ufeff" + HEAD + 'mu = 900\nsource = "Müller 2024"\nnote = "n"\nchecked = "c"\nnumber = 73\n'
    mine = added(tmp_path, text.replace("\n", "\r\n"))
    assert (mine.source, mine.note, mine.checked, mine.number) == ("Müller 2024", "n", "c", 73)


@pytest.mark.parametrize(
    ("lines", "expected"),
    [
        ("", r"\] mu: missing \(form 'neo-hookean' takes mu"),
        ("mu = -900.0", r"'\]: the energy is -312 Pa at the stretch 0.6, expected above 0 .*is a sign, or the conv"),
        ('form = "ogden"\nmu = [900]\nalpha = [-5]', r"energy is -.* Pa at the stretch 0.6, expected above 0"),
        ("mu = 0.0", r"the energy is 0 Pa"),
        ("mu = nan", r"\] mu: found nan, expected a finite number \[Pa\]"),
        ("mu = inf", r"\] mu: found inf, expected a finite number"),
        ("mu = true", r"\] mu: found True, expected a finite number"),
        ('mu = "900 Pa"', r"\] mu: found '900 Pa', expected a finite number"),
        ("mu = [900]", r"\] mu: found \[900\], expected a finite number"),
        (f"mu = 1{'0' * 400}", r"\] mu: found 10*\.\.\., expected a finite number"),
        ("mu = 0.9", r"the shear modulus at rest is 0.9 Pa, expected 1 to 1e\+07 Pa \(write units = \"kPa\""),
        ("mu = 9e9", r"the shear modulus at rest is 9e\+09 Pa, expected 1 to 1e\+07 Pa$"),
        ("mu = 900\nsourc = 3", r"\] sourc: unknown key .*did you mean 'source'\?"),
        ("mu = 900\nnote = 3", r"\] note: found 3, expected text"),
        ("mu = 900\nnumber = -1", r"\] number: found -1, expected a whole number"),
        ('form = "Ogdn"\nmu = 1', r"\] form: found 'Ogdn'.*did you mean 'ogden'\?"),
        ('form = "neo_hookean"\nmu = 1', r"\] form: .*did you mean 'neo-hookean'\?"),
        ('form = "blatz-ko"\nmu = 1', r"\] form: .*expected one of linear, "),
        ('form = ""\nmu = 1', r"\] form: found '', expected text"),
        ('form = "ogden"\nmu = [1, 2]\nalpha = [1]', r"\] mu, alpha: found 2 of mu and 1 of alpha, expected as many"),
        ('form = "ogden"\nmu = []\nalpha = []', r"\] mu: found \[\], expected a finite number or a list of them"),
        ('form = "ogden"\nmu = [900]\nalpha = [0]', r"\] alpha: found \[0\], expected no 0"),
        ('form = "ogden"\nmu = [nan]\nalpha = [2]', r"\] mu: found \[nan\], expected a finite number"),
        ('form = "ogden"\nmu = [900]', r"\] alpha: missing"),
        ('form = "ogden"\nmu = 9\nalpha = 1e9', r"the energy is not finite at the stretch .*narrower stretch"),
        ('form = "ogden"\nconvention = "budy"\nmu = 9\nalpha = 2', r"\] convention: .*did you mean 'budday'\?"),
        ('form = "linear"\nE = 900', r"\] nu: missing \(form 'linear' takes E, nu"),
        ('form = "linear"\nE = 900\nnu = 0.5', r"\] nu: found 0.5, expected a number in the open interval \(-1, 0.5\)"),
        ('form = "gent"\nmu = 900\neta = -1', r"\] eta: found -1, expected a number above 0"),
        ('form = "gent"\nmu = 900\neta = 0.01', r"the energy is not finite at the stretch 0.9"),
        ("E = 900", r"\] E: unknown key with form 'neo-hookean' .*E is of linear"),
        ("mu = 900\nstretch = [1.1, 0.9]", r"\] stretch: found \[1.1, 0.9\], expected \[low, high\] with 0 < low < 1"),
        ("mu = 900\nstretch = [1.1, 1.9]", r"\] stretch: .*1 is rest"),
        ("mu = 900\nstretch = [-0.1, 0.1]", r"\] stretch: "),
        ("mu = 900\nstretch = 0.1", r"\] stretch: found 0.1, expected"),
        ("mu = 900\nstretch = [0.9, nan]", r"\] stretch: found \[0.9, nan\]"),
        ("compression = { mu = 900 }", r"\] tension: missing, found compression only"),
        ("compression = { mu = 9 }\ntension = 3", r"\] tension: found 3, expected a table"),
        ("compression = { mu = 9 }\ntension = { nu = 3 }", r"\] tension.nu: unknown key|tension.mu: missing"),
        ("mu = 9\ncompression = { mu = 9 }\ntension = { mu = 9 }", r"\] mu: found beside compression and tension"),
        ("mu = 9\ncorrected = { mu = 3 }", r"\] corrected: found reason None, expected text"),
        ('mu = 9\ncorrected = { reason = "x" }', r"\] corrected: expected either out = true or keys"),
        ('mu = 9\ncorrected = { out = true, mu = 3, reason = "x" }', r"\] corrected: expected either out"),
        ("mu = 9\ncorrected = 3", r"\] corrected: found 3, expected a table"),
    ],
)
def test_what_can_be_wrong_with_a_study(tmp_path, lines, expected):
    found = problems(tmp_path, HEAD + lines)
    assert found[0].startswith("[study 1 'Mine 2024'")
    assert any(re.search(expected, problem) for problem in found), found


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (b"", r"is empty \(0 bytes\)"),
        (b"\n\n", r"white space only"),
        (b"\xff\xfe\x00", r"expected UTF-8 text"),
        ("[[study", r"found text that is not valid TOML: .*is the file cut off\?"),
        ('[[study]]\nname = "Mi', r"not valid TOML"),
        (f"mu = {'9' * 9999}", r"not valid TOML"),
        (f"mu = {'[' * 5000}", r"not valid TOML"),
        ("x = 1", r"x: unknown key \(expected one of study, units\)"),
        ('units = "Pa"', r"study: found none, expected at least one table"),
        ("study = 3", r"study: found 3, expected"),
        ('[study]\nname = "a"', r"write \[\[study\]\] with two brackets"),
        ('units = "MPa"\n' + HEAD + "mu = 9", r"units: found 'MPa', expected one of Pa, kPa"),
        ("[[study]]\nmu = 9", r"\[study 1\] name: missing"),
        ('[[study]]\nname = 3\ngroup = "linear/brain"\nmu = 9', r"\[study 1\] name: found 3, expected text"),
        ('[[study]]\nname = "a"\nmu = 9', r"\[study 1 'a'\] group: missing"),
        (HEAD.replace("brain", "brian") + "mu = 9", r"\] group: .*did you mean 'hyperelastic/brain'\?"),
        (HEAD.replace("hyperelastic/brain", "mre/white_matter"), r"\] group: .*did you mean 'MRE/white matter'\?"),
        (HEAD.replace("hyperelastic/brain", "liver"), r"\] group: .*expected one of MRE/grey matter, "),
        (HEAD + "mu = 9\n" + HEAD + "mu = 9", r"\[study 2 'Mine 2024'\] name: .*is the name of study 1 'Mine 2024'"),
        (HEAD.replace("Mine 2024", "MRE-Hamhaber2007") + "mu = 9", r"\] name: .*the name of a study that ships"),
    ],
)
def test_what_can_be_wrong_with_a_file(tmp_path, text, expected):
    found = problems(tmp_path, text)
    assert any(re.search(expected, problem) for problem in found), found


def test_no_such_file_and_a_folder(tmp_path):
    (tmp_path / "mine.toml").write_text("")
    with pytest.raises(InputError, match=r"mine.tml: no such file \(is 'mine.toml' meant\?\)"):
        read_studies(add=tmp_path / "mine.tml")
    with pytest.raises(InputError, match="found a folder, expected a file"):
        read_studies(add=str(tmp_path))


def test_all_problems_are_told_at_once(tmp_path):
    bad = 'x = 1\n[[study]]\nname = "a"\ngroup = "b"\nstretch = 3\n' + HEAD + 'form = "ogden"\nmu = "m"\nalpha = 0\n'
    found = problems(tmp_path, bad)
    for expected in ("x: unknown", r"1 'a'\] group", r"1 'a'\] stretch", r"2 .*\] mu: found 'm'", r"2 .*\] alpha: f"):
        assert any(re.search(expected, problem) for problem in found), (expected, found)


def test_a_cut_file_never_raises_anything_else(tmp_path):
    whole = (HEAD + 'form = "ogden"\nmu = [-400.0]\nalpha = [-5.0]\nstretch = [0.9, 1.1]\n').encode()
    rng = np.random.default_rng(0)
    for end in range(len(whole)):
        with suppress(InputError):
            read_studies(add=write(tmp_path, whole[:end]))
    for _ in range(200):
        broken = bytearray(whole)
        broken[rng.integers(len(broken))] = rng.integers(256)
        with suppress(InputError):
            read_studies(add=write(tmp_path, bytes(broken)))
