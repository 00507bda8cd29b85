"""The catalogue of shipped cases says what the cases are."""

import subprocess
import sys

import pytest

from concealed.catalogue import read_entry
from warpbrain.cases.shipped import SHIPPED, catalogue


@pytest.mark.parametrize("entry", catalogue(), ids=lambda entry: f"{entry.name}-{entry.tissue}")
def test_an_entry_is_what_the_case_is(entry):
    assert entry == read_entry(entry.name, entry.tissue), "python -m concealed.catalogue writes it anew"


def test_it_has_every_case():
    assert [(entry.name, entry.tissue) for entry in catalogue()] == [
        (name, tissue) for name, variants in SHIPPED.items() for tissue in variants
    ]


def test_listing_reads_no_mesh():
    code = "import sys; from warpbrain.cli import main; main(['cases']); print({'warp', 'numpy'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout.splitlines()[-1] == "set()"
