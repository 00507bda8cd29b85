"""Label volumes: how they are read, what their labels become, and the mesh that is made of them."""

import gzip

import numpy as np
import pytest

pytest.importorskip("nibabel")

import nibabel
from segmentations import CENTRE, NAMES, ellipsoids, grid_affine, volume_of, write_ellipsoids, write_labels

from warpbrain.cases.building.cleaning import crumbs_given_away
from warpbrain.cases.building.label_fields import CAVITY, label_volumes, make_fields, make_regions, read_labels
from warpbrain.cases.building.lattice import bcc_lattice
from warpbrain.cases.building.mmg import Cells
from warpbrain.cases.building.tissue_names import Assignment, assign, parse_names, preset, presets
from warpbrain.errors import InputError
from warpbrain.images.grid import Grid
from warpbrain.images.reading import Image
from warpbrain.mesh import boundary_faces, components, dihedral_angles, pinched_nodes, split_boundary

SIZE = 14.0
SMALL = np.zeros((6, 7, 8), dtype=np.uint8)
SMALL[1:5, 1:6, 1:7] = 2


def meshed(path, names=NAMES, size=SIZE):
    pytest.importorskip("mmgpy")
    from warpbrain.cases.building.labels import mesh_labels

    image = read_labels(path)
    return mesh_labels(image, assign(label_volumes(image), parse_names([names]), None), size)


# reading


@pytest.mark.parametrize("ending", ["nii", "nii.gz"])
def test_labels_and_affine_are_read(tmp_path, ending):
    affine = np.array([[0, 2.0, 0, -7], [-1.5, 0, 0, 8], [0, 0, 3, 9], [0, 0, 0, 1]])
    image = read_labels(write_labels(tmp_path / f"a.{ending}", SMALL, affine))
    np.testing.assert_array_equal(image.values, SMALL)
    np.testing.assert_allclose(image.grid.affine, affine)
    np.testing.assert_allclose(image.grid.voxel, [1.5, 2, 3])
    assert label_volumes(image) == {2: pytest.approx(120 * 9.0)}
    assert image.notes == ()


def test_one_frame_of_four_dimensions_and_whole_floats(tmp_path):
    image = read_labels(write_labels(tmp_path / "a.nii", SMALL[..., None].astype(np.float32), np.eye(4)))
    np.testing.assert_array_equal(image.values, SMALL)


def test_freesurfer_volumes_are_read(tmp_path):
    nibabel.save(nibabel.MGHImage(SMALL, np.diag([2.0, 2, 2, 1])), tmp_path / "aseg.mgz")
    image = read_labels(tmp_path / "aseg.mgz")
    np.testing.assert_array_equal(image.values, SMALL)
    np.testing.assert_allclose(image.grid.affine, np.diag([2.0, 2, 2, 1]))


@pytest.mark.parametrize(("unit", "factor"), [("meter", 1000.0), ("micron", 0.001), ("unknown", 1.0)])
def test_units_become_millimetres(tmp_path, unit, factor):
    image = read_labels(write_labels(tmp_path / "a.nii", SMALL, np.diag([2.0, 2, 2, 1]), unit))
    np.testing.assert_allclose(image.grid.voxel, 2 * factor)
    assert (f"in units of {unit}: converted" in " ".join(image.notes)) == (factor != 1)


def test_sform_and_qform_that_disagree_are_noted(tmp_path):
    image = nibabel.Nifti1Image(SMALL, np.eye(4))
    shifted = np.eye(4)
    shifted[0, 3] = 12
    image.set_sform(shifted, 1)
    image.set_qform(np.eye(4), 1)
    nibabel.save(image, tmp_path / "a.nii")
    read = read_labels(tmp_path / "a.nii")
    assert read.grid.affine[0, 3] == 12
    assert "disagree by up to 12 mm: the sform is used" in read.notes[0]


def _no_place(image):
    image.set_sform(None, 0)
    image.set_qform(None, 0)


def _singular(image):
    image.set_sform(np.diag([1.0, 1, 0, 1]), 1)


def _furlongs(image):
    image.header["xyzt_units"] = 6


@pytest.mark.parametrize(
    ("values", "change", "message"),
    [
        (0 * SMALL, None, "all 336 voxels are 0"),
        (SMALL * np.float32(0.75), None, r"found 120 voxels of 336 that are none, such as 1\.5"),
        (np.where(SMALL > 0, np.nan, 0).astype(np.float32), None, "found 120 voxels of 336 that are none, such as nan"),
        (-SMALL.astype(np.int16), None, "expected labels of 0 or more, found -2"),
        (SMALL.astype(np.complex64), None, "expected real or whole numbers, .*, found values of type complex64"),
        (np.stack([SMALL, SMALL], axis=-1), None, "three dimensions, found shape 6 x 7 x 8 x 2"),
        (SMALL[0], None, "three dimensions, found shape 7 x 8"),
        (SMALL, _no_place, r"does not say where its voxels are \(sform and qform code 0\)"),
        (SMALL, _singular, "its affine is singular"),
        (SMALL, _furlongs, r"unknown unit of length \(xyzt_units 6\); expected mm, meter or micron"),
    ],
)
def test_volumes_that_are_no_labels(tmp_path, values, change, message):
    image = nibabel.Nifti1Image(values, np.eye(4))
    if change:
        change(image)
    nibabel.save(image, tmp_path / "bad.nii")
    with pytest.raises(InputError, match=f"bad.nii: .*{message}"):
        read_labels(tmp_path / "bad.nii")


def test_files_that_cannot_be_read(tmp_path):
    with pytest.raises(InputError, match=r"none\.nii: no such file"):
        read_labels(tmp_path / "none.nii")
    whole = write_labels(
        tmp_path / "whole.nii.gz", np.random.default_rng(0).integers(0, 9, (20, 20, 20)).astype("u1"), np.eye(4)
    )
    contents = {
        "empty.nii": b"",
        "text.nii": b"no image at all" * 100,
        "text.nii.gz": b"no archive at all" * 100,
        "short.nii.gz": whole.read_bytes()[:1500],
        "short.nii": gzip.decompress(whole.read_bytes())[:1500],
    }
    for name, content in contents.items():
        (tmp_path / name).write_bytes(content)
        with pytest.raises(InputError, match=f"{name}: (not a NIfTI file|the file is cut short)"):
            read_labels(tmp_path / name)


def test_other_images_and_too_many_voxels_are_refused(tmp_path, monkeypatch):
    nibabel.save(nibabel.Spm99AnalyzeImage(SMALL, np.eye(4)), tmp_path / "a.img")
    with pytest.raises(InputError, match=r"a\.img: expected a NIfTI file \(.nii, .nii.gz\), found Spm"):
        read_labels(tmp_path / "a.img")
    monkeypatch.setattr("warpbrain.images.reading.MOST_VOXELS", 300)
    with pytest.raises(InputError, match="6 x 7 x 8 voxels are more than 3e"):
        read_labels(write_labels(tmp_path / "a.nii", SMALL, np.eye(4)))


# names


def test_names_of_labels():
    assert parse_names(["2=grey,41=White", " 3 = gray matter ", "4=Ventricle,24=ignore,16=brain stem"]) == {
        2: "grey matter",
        41: "white matter",
        3: "grey matter",
        4: "ventricle",
        24: "ignore",
        16: "brain stem",
    }


def test_names_as_programs_without_spaces_write_them():
    found = parse_names(["1=GREY_MATTER,2=White-Matter,3=Gray_matter,500=Resection,7=Brain_Stem"])
    assert list(found.values()) == ["grey matter", "white matter", "grey matter", "resection", "Brain_Stem"]


@pytest.mark.parametrize(
    ("argument", "message"),
    [
        ("grey", "expected LABEL=NAME pairs such as 2=grey,3=white, found 'grey'"),
        ("2=grey,", "found ''"),
        ("grey=2", "found 'grey=2'"),
        ("-1=grey", "found '-1=grey'"),
        ("0=grey", "label 0 is always outside"),
        ("2=grey,2=white", "label 2 is named twice, 'grey matter' and 'white'"),
        ("2=", "'' cannot be the name of a tissue"),
        ('2=a"b', "cannot be the name of a tissue"),
        ("4=ventricles", "'ventricles' could be inside or outside the brain: write ventricle"),
        ("24=CSF", "'CSF' could be inside or outside"),
    ],
)
def test_names_that_mean_nothing(argument, message):
    with pytest.raises(InputError, match=message):
        parse_names([argument])


def test_labels_of_one_name_are_one_tissue_of_the_first_number():
    volumes = dict.fromkeys((2, 3, 4, 41, 42, 77), 1e5)
    given = assign(volumes, parse_names(["3=grey,42=grey,41=white,2=white,4=ventricle,77=ignore"]), None)
    assert given == Assignment(
        {3: "grey matter", 41: "white matter"}, {3: 3, 42: 3, 41: 41, 2: 41}, cavity=(4,), outside=(77,)
    )
    assert list(given.tissues) == [3, 41]


def test_labels_that_are_not_named():
    volumes = {label: 1000.0 * label for label in range(1, 9)}
    assert assign(volumes, {}, None).tissues == {label: f"tissue {label}" for label in range(1, 9)}
    with pytest.raises(InputError, match=r"has 9 labels and --tissue does not say .*1 \(1 cm3\), .*9=grey,8=white"):
        assign({**volumes, 9: 9000.0}, {}, None)
    with pytest.raises(InputError, match=r"has 7 labels that --tissue does not name: 2 \(2 cm3\)"):
        assign(volumes, {1: "grey matter"}, None)
    assert assign(volumes, {1: "grey matter"}, "white").number == {1: 1, **dict.fromkeys(range(2, 9), 2)}
    assert assign(volumes, {1: "grey matter"}, "ignore").outside == tuple(range(2, 9))
    with pytest.raises(InputError, match="the volume has no label 11, 12; it has 1, 2, 3, 4, 5, 6, 7, 8"):
        assign(volumes, {1: "a", 11: "b", 12: "c"}, "ignore")
    with pytest.raises(InputError, match="no label is left that is a tissue"):
        assign(volumes, {1: "ventricle"}, "ignore")
    with pytest.raises(InputError, match="41 tissues are more than 40"):
        assign(dict.fromkeys(range(1, 42), 1.0), {n: f"part {n}" for n in range(1, 42)}, None)


# regions and fields


def regions_of(labels, voxel=2.0, names=NAMES):
    image = Image("a.nii", labels.astype(np.int32), Grid(labels.shape, np.diag([voxel, voxel, voxel, 1.0])))
    return make_regions(image, assign(label_volumes(image), parse_names([names]), "ignore"))


def cube():
    labels = np.zeros((24, 24, 24), dtype=int)
    labels[4:20, 5:20, 6:20] = 2
    labels[8:16, 8:16, 8:16] = 3
    labels[11:13, 11:13, 11:13] = 4
    return labels


def test_regions_are_cropped_and_stay_where_they_are():
    regions = regions_of(cube())
    assert regions.codes.shape == (18, 17, 16)
    np.testing.assert_allclose(regions.grid.affine[:3, 3], [6, 8, 10])
    assert regions.labelled == pytest.approx({1: 8.0 * (16 * 15 * 14 - 512), 2: 8.0 * (512 - 8), CAVITY: 64.0})
    assert regions.notes == ()


def test_voids_are_filled_and_small_pieces_left_out():
    labels = cube()
    labels[6, 7, 8] = 0
    labels[12, 12, 12] = 9
    labels[0:2, 0, 0] = 3
    regions = regions_of(labels)
    np.testing.assert_array_equal(regions.codes[5:-1, 6:-1, 7:-1], regions_of(cube()).codes[1:-1, 1:-1, 1:-1])
    assert "2 pieces that do not touch: the largest is meshed, 0.016 cm3 (0.06 %) are left out" in regions.notes[0]
    assert regions.notes[1] == "2 unlabelled voids inside (0.016 cm3) are filled with the nearest label"


@pytest.mark.parametrize(("voxel", "volume"), [(2000.0, "2.688e"), (0.002, "2.688e-08")])
def test_a_mistake_of_units_is_noticed(voxel, volume):
    with pytest.raises(InputError, match=rf"a volume of {volume}.* cm3, expected 1 cm3 to 1e\+04 cm3: .*millimetres"):
        regions_of(cube(), voxel)


@pytest.mark.parametrize(("voxel", "shape"), [((3, 3, 3), (40, 42, 40)), ((0.9, 0.9, 6), (120, 132, 20))])
def test_fields_keep_volumes(voxel, shape):
    affine = grid_affine(voxel, shape)
    image = Image("a.nii", ellipsoids(affine, shape).astype(np.int32), Grid(shape, affine))
    fields = make_fields(make_regions(image, assign(label_volumes(image), parse_names([NAMES]), None)), 8.0)
    cell = abs(np.linalg.det(fields.grid.affine[:3, :3])) * 1e-9
    inside, hollow = fields.body > 0, fields.cavity > 0
    ruling = np.argmax(fields.tissues, axis=0) + 2
    found = {label: ((ruling == label) & inside & ~hollow).sum() * cell for label in (2, 3)}
    found[4] = (inside & hollow).sum() * cell
    for label, volume in found.items():
        assert volume == pytest.approx(volume_of(label), rel=0.01)
    assert min(fields.in_place.values()) > 0.9
    np.testing.assert_allclose(fields.grid.sampled(fields.body, CENTRE[None]), 1 + fields.body.min(), atol=1e-5)


def test_crumbs_go_to_the_neighbour_they_touch_most():
    points, tets = bcc_lattice(np.zeros(3), np.full(3, 8.0), 1.0)
    x, y, z = points[tets].mean(axis=1).T
    labels = np.where(x < 4, 1, 2)
    crumb = (abs(x - 5) < 0.8) & (abs(y - 4) < 0.8) & (abs(z - 4) < 0.8)
    inner = crumb & (abs(x - 5) < 0.4) & (abs(y - 4) < 0.4) & (abs(z - 4) < 0.4)
    given = crumbs_given_away(Cells(points, tets, np.where(inner, 4, np.where(crumb, 3, labels))), 10.0)
    np.testing.assert_array_equal(given, labels)
    np.testing.assert_array_equal(crumbs_given_away(Cells(points, tets, labels), 10.0), labels)


# the mesh


#: Axes that are tilted and mirrored.
TILTED = np.array([[0.0, 0.8, -0.6], [1, 0, 0], [0, 0.6, 0.8]])


def of_tilted_voxels(path):
    """Voxels of three lengths, along tilted axes."""
    return meshed(write_ellipsoids(path, (2, 4, 3), (60, 36, 48), TILTED))


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    return of_tilted_voxels(tmp_path_factory.mktemp("labels") / "a.nii.gz")


def test_mesh_conforms_and_is_good(made):
    assert components(made.mesh.tetrahedra).max() == 0
    assert components(made.mesh.tetrahedra, made.mesh.tissue).max() == 1
    outer, cavities = split_boundary(made.mesh.points, made.mesh.tetrahedra)
    # every face has a partner, but for those of the outer surface and of one cavity
    assert len(cavities) == 1
    assert len(outer) + len(cavities[0]) == len(boundary_faces(made.mesh.tetrahedra))
    assert len(pinched_nodes(boundary_faces(made.mesh.tetrahedra))) == 0
    assert dihedral_angles(made.mesh.points, made.mesh.tetrahedra).min() > 15
    edges = 1e3 * np.diff(made.mesh.points[made.mesh.tetrahedra[:, [0, 1]]], axis=1)
    # a size is asked of the lattice, which is cut at surfaces: 1.8 % off
    assert np.linalg.norm(edges, axis=-1).mean() == pytest.approx(SIZE, rel=0.03)


def test_mesh_has_the_volumes_of_the_labels(made):
    volumes = made.mesh.volumes
    assert set(np.unique(made.mesh.tissue)) == {2, 3}
    # discretisation: flat faces in edges of 14 mm, on layers of half axes of 46 mm, leave out 6.9 % of grey matter and
    # 2.4 % of the whole
    for label in (2, 3):
        assert volumes[made.mesh.tissue == label].sum() == pytest.approx(volume_of(label), rel=0.08)
        assert made.labelled[label] == pytest.approx(volume_of(label), rel=0.01)
    assert volumes.sum() == pytest.approx(volume_of(2) + volume_of(3), rel=0.03)
    np.testing.assert_allclose(1e3 * np.average(made.mesh.centres, axis=0, weights=volumes), CENTRE, atol=0.15)


@pytest.mark.slow(4)
def test_mesh_is_the_same_again(made, tmp_path):
    again = of_tilted_voxels(tmp_path / "a.nii")
    np.testing.assert_array_equal(again.mesh.tetrahedra, made.mesh.tetrahedra)
    np.testing.assert_array_equal(again.mesh.points, made.mesh.points)
    np.testing.assert_array_equal(again.mesh.tissue, made.mesh.tissue)


def test_mesh_lies_where_the_affine_says(made):
    assert np.linalg.det(TILTED) == pytest.approx(-1.0)
    lower, upper = 1e3 * made.mesh.points.min(axis=0), 1e3 * made.mesh.points.max(axis=0)
    # [mm], of voxels of 2 to 4 mm and edges of 14 mm: 0.3 and 0.6 off, and flat faces leave out 2.4 % of the volume
    np.testing.assert_allclose((lower + upper) / 2, CENTRE, atol=0.6)
    np.testing.assert_allclose((upper - lower) / 2, (48, 58, 46), atol=1.0)


@pytest.mark.slow(8)
def test_a_cavity_may_open_to_the_outside(tmp_path):
    affine = grid_affine((3, 3, 3), (40, 42, 40))
    labels = ellipsoids(affine, (40, 42, 40))
    # a channel as wide as the ventricle, to the back
    labels[16:24, :21, 17:23][labels[16:24, :21, 17:23] > 0] = 4
    made = meshed(write_labels(tmp_path / "a.nii", labels, affine), "2=grey,3=grey,4=ventricle")
    sets = made.mesh.node_sets
    assert split_boundary(made.mesh.points, made.mesh.tetrahedra)[1] == []
    deep = np.linalg.norm((1e3 * made.mesh.points - CENTRE) / (48, 58, 46), axis=1)
    assert (deep[sets["ventricle"]] < 0.8).sum() > 30
    assert deep[sets["surface"]].min() > 0.75
    assert set(np.unique(made.mesh.tissue)) == {2}


def test_a_tissue_too_thin_for_the_size_is_named(tmp_path):
    affine = grid_affine((3, 3, 3), (40, 42, 40))
    labels = ellipsoids(affine, (40, 42, 40))
    labels[4:6, 20:22, 19:21] = 7
    path = write_labels(tmp_path / "a.nii", labels, affine)
    with pytest.raises(InputError, match="'pea' is too small or thin for elements of 14 mm: choose a smaller --size"):
        meshed(path, f"{NAMES},7=pea")
    with pytest.raises(InputError, match=r"--size 0\.5: about .* nodes; .* would be 300000, the most here"):
        meshed(path, f"{NAMES},7=pea", 0.5)
    with pytest.raises(InputError, match=r"--size 90: too large for 5.. cm3 of tissue"):
        meshed(path, f"{NAMES},7=pea", 90.0)


# presets


def test_presets_name_labels_as_the_programs_do():
    for name in presets():
        assert preset(name).names
    names = preset("freesurfer").names
    assert (names[3], names[41], names[16], names[4]) == ("grey matter", "white matter", "brain stem", "ventricle")
    assert (names[1035], names[2004], names[12140], names[24]) == (
        *("grey matter", "white matter", "grey matter", "ignore"),
    )
    assert (names[29], names[61], names[14120]) == ("ignore", "ignore", "white matter")
    assert preset("synthseg").names.items() <= names.items()
    assert preset("simnibs").names[2] == "grey matter"
    with pytest.raises(InputError, match="--preset: found 'itk', expected one of freesurfer, synthseg"):
        preset("itk")


def test_labels_of_a_preset_are_each_named_once():
    """A number in two rows of a table would mean what comes last."""
    import tomllib
    from importlib.resources import files

    tables = tomllib.loads((files("warpbrain.cases.building") / "presets.toml").read_text())
    for name, table in tables.items():
        numbers = []
        for tissue, labels in table.items():
            for label in labels if tissue not in ("source", "unsure") else ():
                first, _, last = str(label).partition("-")
                numbers += range(int(first), int(last or first) + 1)
        assert len(numbers) == len(set(numbers)) == len(preset(name).names), name


def test_a_range_names_the_labels_that_there_are():
    there = {2: 1.0, 1003: 1.0, 1017: 1.0, 2035: 1.0, 3000: 1.0}
    arguments = ["2=white,1000-2035=gray", "3000-4035 = white"]
    assert parse_names(arguments) == {2: "white matter"}
    assert parse_names(arguments, there) == {
        **dict.fromkeys((2, 3000), "white matter"),
        **dict.fromkeys((1003, 1017, 2035), "grey matter"),
    }
    for argument, said in (
        ("500-510=resection", "there is no label in 500-510, but 2, 1003"),
        ("1000-1010=grey,1003=white", "label 1003 is named twice"),
        ("20-10=grey", "20-10=grey: the range ends before it begins"),
        ("0-10=grey", "label 0 is always outside"),
        ("1-2-3=grey", "expected LABEL=NAME pairs"),
    ):
        with pytest.raises(InputError, match=f"--tissue: {said}"):
            parse_names([argument], there)


@pytest.mark.parametrize(("name", "meant"), [("gry", "grey matter"), ("whit", "white matter"), ("lesoin", "lesion")])
def test_misspelt_tissues_are_asked_about(name, meant):
    with pytest.raises(InputError, match=f"'{name}': did you mean {meant}"):
        parse_names([f"2={name}"])


def test_other_names_are_taken_as_they_are():
    given = ["2=gel,3=lesion 2,4=brain stem,5=Grey,6=tumour core"]
    assert parse_names(given)[2] == "gel"
    assert parse_names(given)[3] == "lesion 2"
    assert parse_names(given)[5] == "grey matter"


@pytest.mark.slow(5)
def test_a_lattice_that_cannot_be_meshed_is_followed_by_another(tmp_path, monkeypatch):
    """Of the template in voxels of 4 mm one of a hundred sizes could not be meshed at all."""
    pytest.importorskip("mmgpy")
    from warpbrain.cases.building import labels

    whole, calls = labels.remesh, []

    def fails_at_first(cells, edge):
        calls.append(len(cells.tetrahedra))
        return None if len(calls) == 1 else whole(cells, edge)

    monkeypatch.setattr(labels, "remesh", fails_at_first)
    path = write_ellipsoids(tmp_path / "a.nii.gz")
    assert meshed(path, size=20.0).mesh.tissue.size > 100
    assert calls[1] > calls[0]
    monkeypatch.setattr(labels, "remesh", lambda cells, edge: None)
    with pytest.raises(InputError, match=r"with elements of about 20 mm: try another --size"):
        meshed(path, size=20.0)
