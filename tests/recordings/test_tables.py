"""CSV files: what is read, and that everything wrong in one is said at once, with row and column."""

from pathlib import Path

import numpy as np
import pytest

from warpbrain.problems import Problems, Unreadable
from warpbrain.recordings.tables import Table, read_table
from warpbrain.recordings.text import LISTED, collected


def table_of(folder: Path, content: str | bytes, known=("x", "y", "t")) -> tuple[Table | None, Problems]:
    file = folder / "table.csv"
    file.write_bytes(content.encode() if isinstance(content, str) else content)
    problems = Problems()
    try:
        return read_table(file, problems, known), problems
    except Unreadable:
        return None, problems


@pytest.mark.parametrize(
    "content",
    [
        "x,y\n1,2\n3,4\n",
        "\ufeffx,y\n1,2\n3,4",
        "# made by hand\n\n y , x # in mm\n2, 1 # first\n\n,\n4,3\n",
        "x;y;note\r\n1;2;a\r\n3;4;b, c\r\n",
        "y\tx\n2\t1\n4\t3\n",
        'x,note,y\n1,"a, # b",2\n"3",,4\n',
        "x,y\r1,2\r3,4\r",
    ],
    ids=["plain", "byte order mark", "comments and order", "semicolons", "tabs", "quotes", "old Macintosh"],
)
def test_what_is_read(tmp_path, content):
    table, problems = table_of(tmp_path, content)
    np.testing.assert_array_equal(table.vectors("x", "y"), [[1, 2], [3, 4]])
    assert not problems


@pytest.mark.parametrize(
    ("content", "place", "message", "cure"),
    [
        (b"", "", "is empty (0 bytes)", ""),
        (" \n", "", "white space only", ""),
        ("# x,y\n", "", "comments only", ""),
        ("x,y\n", "", "a header and no rows", ""),
        ("1,2\n3,4\n", "row 1", "found numbers, expected a header such as x,y,t", "must not start with #"),
        ("x,y\n1,2\xe9\n".encode("latin-1"), "row 2", "found byte 0xe9 at position 7, expected UTF-8", "UTF-8"),
        ("x,x,y\n1,2,3\n", "header", "found column 'x' 2 times", ""),
        ("x,y\n1,2\n\n3\n", "row 4", "found 1 field, expected 2", "cut off"),
        ("x,y\n1,2\n3,4,5\n", "row 3", "found 3 fields, expected 2", ""),
        ('x,y\n1,"2\n', "row 2", "quotation mark that is not closed", ""),
        ("x,y\n1,two\n", "row 2, column y", "found 'two', expected a number", ""),
        ("x;y\n1;2,5\n", "row 2, column y", "found '2,5', expected a number", "with a point"),
        ("x,y\n1,1_000\n", "row 2, column y", "found '1_000', expected a number", ""),
        ("x,y\n1,\n", "row 2, column y", "found nothing", "leave out rows"),
        ("x,y\n1,nan\n", "row 2, column y", "found 'nan', expected a finite number", ""),
        ("x,y\n1,-inf\n", "row 2, column y", "found '-inf', expected a finite number", ""),
        ("x,Y [mm]\n1,2\n", "header", "found no column 'y', found x, Y [mm]", "'Y [mm]' meant?"),
    ],
)
def test_what_is_wrong(tmp_path, content, place, message, cure):
    table, problems = table_of(tmp_path, content)
    if table is not None and table.has("x", "y"):
        table.vectors("x", "y")
    assert len(problems.found) == 1, [str(problem) for problem in problems.found]
    problem = problems.found[0]
    assert problem.file == tmp_path / "table.csv"
    assert problem.place == place
    assert message in problem.message
    assert cure in problem.cure
    assert len(str(problem)) - len(str(problem.file)) < 200


def test_all_of_it_is_said_at_once(tmp_path):
    table, problems = table_of(tmp_path, "x,y,t\n1,a,0\n2,2\nb,3,0\n")
    table.vectors("x", "y")
    table.times(strictly=True)
    assert [problem.place for problem in problems.found] == [
        "row 3",
        "row 4, column x",
        "row 2, column y",
        "row 4, column t",
    ]


def test_columns_that_mean_nothing_are_remarked_upon(tmp_path):
    _, problems = table_of(tmp_path, "x,y,sigmma\n1,2,3\n")
    assert not problems
    assert "ignores column sigmma" in problems.remarks[0]


@pytest.mark.parametrize(
    ("times", "strictly", "of", "rows"),
    [
        ("0 1 2", True, None, []),
        ("0 0 1", True, None, [3]),
        ("0 0 1", False, None, []),
        ("0 2 1 3", False, None, [4]),
        ("0 0 1 1", True, "abab", []),
        ("0 0 1 1", True, "aabb", [3, 5]),
        ("5 0 6 1", True, "abab", []),
    ],
)
def test_time_goes_on(tmp_path, times, strictly, of, rows):
    table, problems = table_of(tmp_path, "t\n" + times.replace(" ", "\n"))
    table.times(strictly=strictly, of=of)
    assert [problem.place for problem in problems.found] == [f"row {row}, column t" for row in rows]


def test_bounds(tmp_path):
    table, problems = table_of(tmp_path, "x\n-1\n0\n1\n")
    table.bounded("x", 0.0, itself=True)
    table.bounded("x", 0.0, itself=False)
    assert [problem.message for problem in problems.found] == [
        "found -1, expected 0 or more",
        "found -1, expected more than 0",
        "found 0, expected more than 0",
    ]


def test_files_that_are_none(tmp_path):
    problems = Problems()
    (tmp_path / "points.csv").write_text("x\n1\n")
    (tmp_path / "large.csv").touch()
    with (tmp_path / "large.csv").open("r+b") as file:
        file.truncate(65 * 2**20)
    for name in ("point.csv", ".", "nowhere/x.csv", "large.csv"):
        with pytest.raises(Unreadable):
            read_table(tmp_path / name, problems, ())
    texts = [problem.message + " " + problem.cure for problem in problems.found]
    for text, words in zip(
        texts, ("no such file is 'points.csv' meant?", "found a folder", "there is no folder", "is 65 MB"), strict=True
    ):
        assert words in text


def test_long_lists_end(tmp_path):
    content = "x\n" + "a\n" * (LISTED + 5)
    (tmp_path / "t.csv").write_text(content)
    problems = Problems()
    with collected(tmp_path / "t.csv", problems) as found:
        read_table(tmp_path / "t.csv", found, ("x",)).numbers("x")
    assert len(problems.found) == LISTED + 1
    assert problems.found[-1].message == "and 5 more problems in this file"
