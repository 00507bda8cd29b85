"""Answers are scored as the tool's are, after they are fixed, by code that knows no `warpbrain`."""

import csv
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from neutral_cases import neutral
from said import diagnosis, label, sealed_labels

from referee.__main__ import main
from referee.challenge import score as scoring
from referee.challenge.answers import COLUMNS, Answer, commit, read_answers, write_answers
from referee.challenge.leaderboard import leaderboard
from referee.challenge.neutral import read_case, write_case
from referee.challenge.of_tool import answer_of
from referee.challenge.score import score, write_scores
from referee.diagnoses import read_diagnosis
from referee.errors import InputError

ROOT = Path(__file__).resolve().parents[2]
ANSWERS = [
    Answer("n1", "nothing missing", (), 0.9),
    Answer("n2", "named", ("gravity",), 0.6),
    Answer("g1", "group", ("gravity", "pressure"), 0.9),
    Answer("p1", "named", ("pressure",), 0.8),
    Answer("2a", "named", ("gravity", "swelling")),
    Answer("o1", "unknown", (), 0.7),
    Answer("t1", "nothing missing", (), 0.5),
]


@pytest.fixture
def sealed(tmp_path):
    """A folder of labels and committed answers."""
    labels = [
        label("n1"),
        label("n2"),
        label("g1", "effect", ("gravity",), 9.0),
        label("p1", "effect", ("pressure",), 12.0),
        label("p2", "effect", ("pressure",), 12.0),
        label("2a", "two", ("gravity", "swelling"), 9.0, conditional=8.5),
        label("o1", "outside", ("tether",), 9.0),
        label("t1", "trap", ("noise",)),
    ]
    sealed_labels(tmp_path / "labels", *labels)
    write_answers(tmp_path / "mine.csv", ANSWERS)
    commit(tmp_path / "mine.csv")
    return tmp_path


def scored(folder, **more):
    return score(
        folder / "mine.csv",
        folder / "labels",
        commitment=folder / "mine.csv.sha256",
        commitments=folder / "labels" / "commitments.txt",
        **more,
    )


def test_scores(sealed):
    found = scored(sealed)
    counts = {name: (told["hits"], told["of"]) for name, told in found["shares"].items()}
    # n1, g1, p1, 2a, o1, t1 of eight; that without an answer is none
    assert counts["answers right"] == (6, 8)
    assert found["without_answer"] == ["p2"]
    assert counts["false alarms"] == (1, 2)
    assert counts["traps named as physics"] == (0, 1)
    assert counts["spoken names right"] == (2, 3)
    assert counts["right name alone, d >= 8"] == (1, 3)
    assert counts["right name or group holding it, d >= 8"] == (2, 3)
    assert counts["both of two named, each d >= 8"] == (1, 1)
    assert counts["unknown found, d >= 8"] == (1, 1)
    assert {name: told["hits"] for name, told in found["mechanisms"].items()} == {"gravity": 0, "pressure": 1}
    stated, right = np.array([0.9, 0.6, 0.9, 0.8, 0.7, 0.5]), np.array([1, 0, 1, 1, 1, 1])
    assert found["calibration"]["of"] == 6
    assert found["calibration"]["brier"] == pytest.approx(np.mean((stated - right) ** 2))


def test_cases_that_are_not_listed_stay_sealed(sealed):
    (sealed / "cases.txt").write_text("n1\nn2\n")
    write_answers(sealed / "mine.csv", ANSWERS[:2])
    commit(sealed / "mine.csv")
    for file in (sealed / "labels").glob("[!n]*.json.gz"):
        file.write_bytes(b"not to be opened")
    assert scored(sealed, cases=sealed / "cases.txt")["cases"] == 2


@pytest.mark.parametrize("how", ["no commitment", "other answers"])
def test_no_label_is_opened_before_answers_are_fixed(sealed, how, monkeypatch):
    if how == "no commitment":
        (sealed / "mine.csv.sha256").unlink()
    else:
        write_answers(sealed / "mine.csv", ANSWERS[1:])

    def opened(*given):
        raise AssertionError("a label was opened")

    monkeypatch.setattr(scoring, "open_labels", opened)
    with pytest.raises(InputError, match=r"no commitment to mine\.csv|mine\.csv: its hash is"):
        scored(sealed)


def test_answers_to_other_cases_are_refused(sealed):
    write_answers(sealed / "mine.csv", [*ANSWERS, Answer("x9", "cannot say")])
    commit(sealed / "mine.csv")
    with pytest.raises(InputError, match="x9: no case of this set"):
        scored(sealed)


@pytest.mark.parametrize(
    ("row", "says"),
    [
        ("a,perhaps,,", "verdict 'perhaps'"),
        ("a,named,,0.5", "'named' with 0 names"),
        ("a,nothing missing,gravity,", "'nothing missing' with 1 names"),
        ("a,named,gravity,1.5", "expected 0 to 1"),
        ("a,named,gravity,nan", "expected 0 to 1"),
        ("a,named,gravity,high", "expected a number"),
        ("a,unknown,,\na,unknown,,", "'a' has an answer already"),
    ],
)
def test_answers_that_are_none_are_refused(tmp_path, row, says):
    (tmp_path / "mine.csv").write_text(f"{','.join(COLUMNS)}\n{row}\n")
    with pytest.raises(InputError, match=re.escape(says)):
        read_answers(tmp_path / "mine.csv")


def test_answers_and_cases_come_back(tmp_path):
    write_answers(tmp_path / "mine.csv", ANSWERS)
    assert list(read_answers(tmp_path / "mine.csv").values()) == ANSWERS
    case = neutral()
    write_case(tmp_path / "made.npz", case)
    found = read_case(tmp_path / "made.npz")
    assert found.name == "made"
    assert np.array_equal(found.recorded, case.recorded)
    assert found.covariance == pytest.approx(case.covariance, rel=1e-6)
    (tmp_path / "made.npz").write_bytes(b"")
    with pytest.raises(InputError, match=r"made\.npz: not a case"):
        read_case(tmp_path / "made.npz")


def test_answers_of_the_tool(tmp_path):
    rows = [
        {"causes": [], "kinds": [], "log_evidence": 0.0, "log_prior": 0.0, "probability": 0.6},
        {"causes": ["gravity"], "kinds": ["physics"], "log_evidence": 0.0, "log_prior": 0.0, "probability": 0.3},
        {"causes": ["pressure"], "kinds": ["physics"], "log_evidence": 0.0, "log_prior": 0.0, "probability": 0.1},
    ]

    def said(*given, **more):
        import json

        (tmp_path / "diagnosis.json").write_text(json.dumps(diagnosis(*given, hypotheses=rows, **more)))
        return answer_of("c", read_diagnosis(tmp_path / "diagnosis.json"))

    assert said() == Answer("c", "nothing missing", (), 0.6)
    assert said("named", "gravity", 0.3) == Answer("c", "named", ("gravity",), 0.3)
    both = said("group", "gravity", 0.3, group=["gravity", "pressure"])
    assert (both.verdict, both.names, both.probability) == ("group", ("gravity", "pressure"), pytest.approx(0.4))
    assert said("cannot say") == Answer("c", "cannot say")


def test_the_leaderboard(sealed):
    write_scores(sealed / "results" / "set" / "mine.json", scored(sealed, about="by hand", of_set="Eight"))
    page = leaderboard(sealed / "results")
    assert "## Eight" in page
    assert "| mine | 6 of 8 (" in page
    with pytest.raises(InputError, match="no scores"):
        leaderboard(sealed)


def test_the_page_of_results_is_the_leaderboard():
    page = (ROOT / "bench" / "results" / "challenge" / "README.md").read_text(encoding="utf-8")
    assert page == leaderboard(ROOT / "bench" / "results" / "challenge")


_BLOCKED = """
import sys

class Blocked:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in ("warpbrain", "warp", "felupe"):
            raise ImportError(f"{name} is not here")

sys.meta_path.insert(0, Blocked())
from referee.__main__ import main
import referee.challenge.of_tool
folder, out = sys.argv[1:]
for given in (
    ["baselines", folder, "--out", out],
    ["commit", f"{out}/lasso.csv"],
    ["score", f"{out}/lasso.csv", f"{folder}/labels", "--out", f"{out}/scores/set/lasso.json"],
    ["leaderboard", "--results", f"{out}/scores", "--out", f"{out}/leaderboard.md"],
):
    assert main(["challenge", *given]) == 0, given
assert main(["challenge", "score", f"{out}/gp-discrepancy.csv", f"{folder}/labels"]) == 2
"""


def test_who_takes_part_needs_no_warpbrain(tmp_path):
    write_case(tmp_path / "made.npz", neutral())
    (tmp_path / "cases.txt").write_text("made\n")
    sealed_labels(tmp_path / "labels", label("made"))
    command = [sys.executable, "-c", _BLOCKED, str(tmp_path), str(tmp_path / "out")]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "answers right: 1 of 1" in done.stdout
    assert "no commitment to gp-discrepancy.csv" in done.stderr


def test_the_example_of_the_page_answers(tmp_path):
    page = (ROOT / "docs" / "challenge.md").read_text(encoding="utf-8")
    example = re.search(r"```python\n(.*?)```", page, re.DOTALL).group(1)
    assert "referee" not in example and "warpbrain" not in example
    case = neutral()
    write_case(tmp_path / "nothing.npz", case)
    effect = 8.0 * case.cause_response[:, case.cause_name == "pressure"].sum(axis=1)
    object.__setattr__(case, "recorded", case.recorded + effect)
    write_case(tmp_path / "pressed.npz", case)
    (tmp_path / "example.py").write_text(example)
    command = [sys.executable, "example.py", ".", "mine.csv"]
    subprocess.run(command, cwd=tmp_path, check=True)
    with (tmp_path / "mine.csv").open(newline="") as stream:
        rows = {row["case"]: row for row in csv.DictReader(stream)}
    assert rows["nothing"]["verdict"] == "nothing missing"
    assert (rows["pressed"]["verdict"], rows["pressed"]["names"]) == ("named", "pressure")
    assert main(["challenge", "commit", str(tmp_path / "mine.csv")]) == 0
