"""What is read of a `.feb` file, of both formats, and what is refused."""

import dataclasses

import numpy as np
import pytest

from febio.materials import constitution
from febio.problem import read_problems, write_problems
from febio.reader import UnsupportedError, read_feb

MESH = """<Mesh><Nodes name="all"><node id="3">0,0,0</node><node id="5">1,0,0</node><node id="7">0,1,0</node>
  <node id="9">0,0,1</node></Nodes>
  <Elements type="tet4" name="body"><elem id="1">3,5,7,9</elem></Elements>
  {sets}
  <Surface name="side"><tri3 id="1">3,7,5</tri3></Surface></Mesh>"""
LISTED = '<NodeSet name="foot"><n id="3"/><n id="5"/></NodeSet><NodeSet name="tip"><n id="9"/></NodeSet>'
LAW = """<Material><material id="1" name="soft" type="neo-Hookean"><density>1</density><E>2</E><v>0.3</v></material>
  </Material>"""
REST = """<MeshDomains><SolidDomain name="body" mat="soft"/></MeshDomains>
  <LoadData><load_controller id="1" type="loadcurve"><interpolate>LINEAR</interpolate>
  <points>{points}</points></load_controller></LoadData>"""
OLD = f"""<febio_spec version="3.0"><Module type="solid"/>
  <Control><analysis>STATIC</analysis><time_steps>4</time_steps><step_size>0.25</step_size></Control>
  {LAW}{MESH.format(sets=LISTED)}
  <Boundary><bc type="fix" node_set="foot"><dofs>x,z</dofs></bc>
   <bc type="prescribe" node_set="tip"><dof>z</dof><scale lc="1">0.5</scale><relative>0</relative></bc></Boundary>
  <Loads><surface_load type="pressure" surface="side"><pressure lc="1">3</pressure><linear>0</linear></surface_load>
   <nodal_load type="nodal_load" node_set="tip"><dof>x</dof><scale lc="1">7</scale></nodal_load></Loads>
  {REST.format(points="<point>0,0</point><point>1,2</point>")}</febio_spec>"""
NEW = f"""<febio_spec version="4.0"><Module type="solid"/>
  <Control><analysis>STATIC</analysis><time_steps>4</time_steps><step_size>0.25</step_size></Control>
  {LAW}{MESH.format(sets='<NodeSet name="foot">3,5</NodeSet><NodeSet name="tip">9</NodeSet>')}
  <Boundary><bc type="zero displacement" node_set="foot"><x_dof>1</x_dof><y_dof>0</y_dof><z_dof>1</z_dof></bc>
   <bc type="prescribed displacement" node_set="tip"><dof>z</dof><value lc="1">0.5</value><relative>0</relative></bc>
  </Boundary>
  <Loads><surface_load type="pressure" surface="side"><pressure lc="1">3</pressure></surface_load>
   <nodal_load type="nodal_load" node_set="tip"><dof>x</dof><scale lc="1">7</scale></nodal_load></Loads>
  {REST.format(points="<pt>0,0</pt><pt>1,2</pt>")}</febio_spec>"""


def read(text):
    return read_feb(text, "ex01", "Verify/ex01.feb", "0" * 40, 1.0)


def test_both_formats_say_the_same():
    assert read(OLD) == read(NEW)


def test_what_is_read():
    problem = read(OLD)
    assert problem.elements == [{"type": "tet4", "material": "soft", "nodes": [[0, 1, 2, 3]]}]
    assert problem.fixed == {"x": [0, 1], "z": [0, 1]}
    held, values = problem.constraints(0.5)
    assert held[3].tolist() == [False, False, True] and values[3, 2] == 0.5
    assert problem.nodal_forces(problem.end)[3].tolist() == [14.0, 0.0, 0.0]
    assert problem.pressures[0]["faces"] == [[0, 2, 1]]
    law = constitution(problem, "soft", problem.end).material
    assert (law.law.shear_modulus, law.poisson) == (pytest.approx(1.0 / 1.3), 0.3)


def test_norm_counts_what_is_solved_for():
    u = np.array([[9.0, 1.0, 9.0], [9.0, 1.0, 9.0], [1.0, 1.0, 1.0], [2.0, 4.0, 9.0]])
    assert read(OLD).norm(u) == 5.0


def test_traction_follows_the_area():
    old = '<surface_load type="pressure" surface="side"><pressure lc="1">3</pressure>'
    new = '<surface_load type="traction" surface="side"><scale lc="1">3</scale><traction>0,0,1</traction>'
    assert old in OLD
    problem = read(OLD.replace(old, new))
    # a triangle of area 1/2, twice as large
    u = np.array([[0.0] * 3, [1.0, 0.0, 0.0], [0.0] * 3, [0.0] * 3])
    forces = problem.traction_forces(u, problem.end)
    np.testing.assert_allclose(forces[:, 2], [2.0, 2.0, 2.0, 0.0], atol=1e-14)


def test_files_of_our_own_say_the_same(tmp_path):
    problem = read(OLD)
    write_problems(tmp_path / "ex.json", [problem, dataclasses.replace(problem, name="ex02", fixed={}, curves={})])
    back = read_problems(tmp_path)
    assert back[0] == problem
    assert (back[1].fixed, back[1].curves) == ({}, {})


@pytest.mark.parametrize(
    ("was", "becomes", "reason"),
    [
        ("<febio_spec", '<!DOCTYPE a [<!ENTITY b SYSTEM "file:///etc/hosts">]><febio_spec', "document type"),
        ('version="3.0"', 'version="2.5"', "format 2.5"),
        ('type="solid"', 'type="biphasic"', "module biphasic"),
        ('type="tet4"', 'type="tri3"', "elements tri3"),
        ("<Boundary>", "<Step><step/></Step><Boundary>", "section Step"),
        ("<Boundary>", "<Contact><contact/></Contact><Boundary>", "section Contact"),
        ('type="fix"', 'type="rigid"', "boundary condition rigid"),
        ("x,z</dofs>", "x,u</dofs>", "degree of freedom u"),
        ("<relative>0", "<relative>1", "relative to the step before"),
        ('surface_load type="pressure"', 'surface_load type="fluidflux"', "load fluidflux"),
        ('load_controller id="1" type="loadcurve"', 'load_controller id="1" type="math"', "load controller math"),
        ("<points>", "<extend>REPEAT</extend><points>", "repeated"),
        ('surface="side"><pressure', 'surface="none"><pressure', "surface 'none'"),
        ('bc type="fix" node_set="foot"', 'bc type="fix" node_set="none"', "node set 'none'"),
    ],
)
def test_what_is_not_supported_is_said(was, becomes, reason):
    assert was in OLD
    with pytest.raises(UnsupportedError, match=reason):
        read(OLD.replace(was, becomes, 1))


def test_a_law_that_is_not_there_is_said():
    problem = read(OLD.replace('"neo-Hookean"', '"Veronda-Westmann"'))
    with pytest.raises(UnsupportedError, match="material Veronda-Westmann"):
        constitution(problem, "soft", 1.0)
