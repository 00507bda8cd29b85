"""The catalogue of shipped cases says what the cases are."""

import subprocess
import sys

import pytest

from concealed.catalogue import entry_of
from warpbrain.cases.shipped import BEAM, RESECT, SHIPPED, STAND_INS, catalogue, find_case


def same_mesh(entry):
    """Whether all that it has beside an entry of the same mesh are landmarks, which are those of both tissues."""
    return entry.name in RESECT[1:] and entry.tissue == "single"


@pytest.mark.parametrize(
    "entry",
    [pytest.param(entry, marks=[pytest.mark.slow(1)] if same_mesh(entry) else []) for entry in catalogue()],
    ids=lambda entry: f"{entry.name}-{entry.tissue}",
)
def test_an_entry_is_what_the_case_is(entry):
    name, case = entry.name, find_case(entry.name, entry.tissue)
    assert entry == entry_of(case, name, entry.tissue), "python -m concealed.catalogue writes it anew"
    assert sorted(case.tissues) == ([1] if entry.tissue == "single" or name in BEAM else [1, 2])
    assert case.origin == ("stand-in" if name in STAND_INS else "measured" if name in (*RESECT, *BEAM) else "synthetic")
    assert (case.resection is not None) == (name in STAND_INS)


def test_it_has_every_case():
    assert [(entry.name, entry.tissue) for entry in catalogue()] == [
        (name, tissue) for name, variants in SHIPPED.items() for tissue in variants
    ]


def test_listing_reads_no_mesh():
    code = "import sys; from warpbrain.cli import main; main(['cases']); print({'warp', 'numpy'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout.splitlines()[-1] == "set()"
