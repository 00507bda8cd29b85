"""`import warpbrain as wb`: the names, what wrong calls say, and that nothing is printed."""

import ast
import io
import pydoc
import subprocess
import sys
from contextlib import redirect_stdout

import pytest
from folders import write_folder

import warpbrain as wb


def test_every_name_is_there():
    for name in dir(wb):
        assert getattr(wb, name) is not None, name


def test_type_checkers_are_told_the_same_names():
    stub = ast.parse(_stub())
    told = {alias.asname for node in ast.walk(stub) if isinstance(node, ast.ImportFrom) for alias in node.names}
    told |= {node.target.id for node in stub.body if isinstance(node, ast.AnnAssign)}
    assert told - {None, "__version__"} == set(dir(wb))


def _stub() -> str:
    from importlib.resources import files

    return (files("warpbrain") / "__init__.pyi").read_text(encoding="utf-8")


def test_help_is_a_page():
    text = io.StringIO()
    with redirect_stdout(text):
        pydoc.Helper(output=text).help(wb)
    lines = text.getvalue().splitlines()
    assert len(lines) <= 62
    for name in ("wb.run", "wb.estimate", "wb.diagnose", "wb.ensemble", ".plot()", "cases", "laws, mechanisms"):
        assert any(name in line for line in lines[:24]), name


def test_cases_laws_and_mechanisms_are_mappings():
    assert "0529" in wb.cases and len(list(wb.cases)) == len(wb.cases)
    assert wb.cases["beam-52g"].name == wb.find_case("beam-52g").name
    assert wb.laws["ogden"] is wb.Ogden and wb.mechanisms["gravity"] is wb.Gravity
    with pytest.raises(KeyError, match="there are: 0529"):
        wb.cases["0592"]


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: wb.run(5), "case: expected a Case, the name of a shipped case .* found int"),
        (lambda: wb.run("0592"), "did you mean '0529'"),
        (lambda: wb.run("0529", tissue="two"), "tissue 'two': expected 'multi' or 'single'"),
        (lambda: wb.run("0529", steps=0), "steps = 0: expected a whole number"),
        (lambda: wb.run("0529", until=-1.0), "until = -1: expected a positive number"),
        (lambda: wb.run("0529", tolerance=2.0), "tolerance = 2: expected a number between"),
        (lambda: wb.run("0529", to_rest=True, steps=3), "to_rest: means nothing with steps"),
        (lambda: wb.run("0529", elements="hex"), "elements = 'hex': expected one of tet4"),
        (lambda: wb.run("0529", device="gpu"), "device 'gpu': not found .*there are: cpu"),
        (lambda: wb.run("0529", precision="half"), "precision 'half': expected one of"),
        (lambda: wb.run("beam-52g", elements="tet9"), "elements = 'tet9'"),
        (lambda: wb.estimate(None), "case: expected a Case"),
        (lambda: wb.diagnose(None), "case: expected a Case"),
        (lambda: wb.ensemble("0529", samples=0), "samples = 0: expected a whole number"),
        (lambda: wb.ensemble("0529", samples="many"), "samples = 'many'"),
        (lambda: wb.ensemble("0529", 2, processes=0), "processes = 0"),
        (lambda: wb.plot(5), "what: expected a result, a case or a mesh, found int"),
        (lambda: wb.html(5), "what: expected a result or a case, found int"),
        (lambda: wb.estimate("0529", options=5), "options: expected EstimationOptions.*, found int"),
        (lambda: wb.diagnose("0529", options=5), "options: expected DiagnosisOptions.*, found int"),
        (lambda: wb.DiagnosisOptions(candidates="gravity"), "candidates: expected a sequence of names, found str"),
        (lambda: wb.ensemble("0529", 2, batch=0), "batch = 0"),
        (lambda: wb.ensemble("0529", 2, dask=5), "dask: expected the address of a scheduler"),
        (lambda: wb.assume("0529", "gravity"), "case: expected a Case, as warpbrain.find_case gives, found str"),
        (lambda: wb.with_prior_draw("0529", 1), "case: expected a Case, as warpbrain.find_case gives, found str"),
        (lambda: wb.model_of("0529"), "case: expected a Case, as warpbrain.find_case gives, found str"),
        (lambda: wb.observe("0529", None), "case: expected a Case, as warpbrain.find_case gives, found str"),
        (lambda: wb.write_case("folder", "0529"), "case: expected a Case, as warpbrain.find_case gives, found str"),
        (lambda: wb.System("0529"), "model: expected a Model, as warpbrain.model_of.* gives, found str"),
        (lambda: wb.solve_equilibrium(5), "system: expected a System, .* found int"),
        (lambda: wb.relax_to_rest(5), "system: expected a System, .* found int"),
        (lambda: wb.Simulator(5), "system: expected a System, .* found int"),
        (lambda: wb.result_of(5), "system: expected a System, .* found int"),
        (lambda: wb.read_mesh(5), "path: expected the path of a mesh, found int"),
        (lambda: wb.write_mesh("a.vtu", 5), "mesh: expected a TetMesh, .* found int"),
        (lambda: wb.read_case(5), "path: expected the path of a case.toml or its folder, found int"),
        (lambda: wb.check_case(5), "file: expected the path of a case.toml or its folder, found int"),
        (lambda: wb.Material(5), "law: expected a Law, .* found int"),
        (lambda: wb.require_stable(5), "law: expected a Law, .* found int"),
        (lambda: wb.MooneyRivlin("a", 1.0), "C1, C2 = 'a': expected a finite number"),
    ],
)
def test_a_wrong_call_names_the_parameter_and_the_cure(call, said):
    with pytest.raises(wb.InputError, match=said):
        call()


def test_a_name_that_is_nearly_right_is_told():
    with pytest.raises(AttributeError, match="did you mean 'estimate'"):
        _ = wb.estimat


def test_nothing_is_printed(tmp_path):
    code = f"import warpbrain as wb; wb.run({str(write_folder(tmp_path))!r})._repr_html_()"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=300, check=True)
    assert done.stdout == ""
