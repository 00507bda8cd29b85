"""The site: `.ci/site` builds it with every example run.

With `GALLERY=0` in the environment none is, with `GALLERY=2/4` the second of each four."""

from __future__ import annotations

import importlib
import importlib.metadata
import inspect
import os
import re
import sys
import tomllib
from pathlib import Path
from typing import Any

import pyvista
from docutils import nodes
from sphinx.util.docutils import SphinxDirective

sys.path.insert(0, str(Path(__file__).parent))
from figure_records import read_records

ROOT = Path(__file__).parents[1]

# gallery scripts run in processes of their own kind: no window, one picture style
pyvista.OFF_SCREEN = True
pyvista.BUILDING_GALLERY = True
os.environ.setdefault("MPLBACKEND", "agg")

project = "warpbrain"
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
author = ", ".join(person["name"] for person in PROJECT["authors"])
copyright = f"{author}, {PROJECT['license']}"
# where files of the repository are read by people, once it is published
REPOSITORY = PROJECT.get("urls", {}).get("Repository")
try:
    release = importlib.metadata.version("warpbrain")
except importlib.metadata.PackageNotFoundError:
    release = "0+unknown"

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_gallery.gen_gallery",
]
exclude_patterns = ["_build", "gallery/*.ipynb", "gallery/*.py", "gallery/*.md5", "gallery/*.zip", "figures"]
html_theme = "furo"
html_title = f"warpbrain {release}"
html_copy_source = False
html_static_path = ["_static"]
html_css_files = ["tables.css"]

myst_enable_extensions = ["colon_fence"]
myst_heading_anchors = 4
# a heading level may be skipped where a page was made from a table; several classes have an attribute of one name
suppress_warnings = ["myst.header", "config.cache", "ref.python"]

default_role = "py:obj"
autodoc_typehints = "none"
autodoc_member_order = "bysource"
napoleon_numpy_docstring = True
napoleon_google_docstring = False
napoleon_use_ivar = True

# which examples are run
PART, _, PARTS = os.environ.get("GALLERY", "1").partition("/")
EXAMPLES = sorted(path.name for path in (ROOT / "examples").glob("plot_*.py"))

sphinx_gallery_conf = {
    "examples_dirs": "../examples",
    "gallery_dirs": "gallery",
    "filename_pattern": "|".join(map(re.escape, EXAMPLES[int(PART) - 1 :: int(PARTS or "1")])),
    "ignore_pattern": r"__init__\.py|there_and_back\.py",
    "image_scrapers": ("matplotlib", "pyvista", "gallery_figures"),
    "reset_modules": ("matplotlib",),
    "download_all_examples": False,
    "remove_config_comments": True,
    "show_memory": False,
    # its page would fetch scripts from the network
    "write_computation_times": False,
    # an example that fails is a site that is wrong
    "abort_on_example_error": True,
    "only_warn_on_example_error": False,
    "within_subsection_order": "FileNameSortKey",
    "nested_sections": False,
    "plot_gallery": PART != "0",
}


def linked_elsewhere(app: Any, name: str, source: list[str]) -> None:
    """Before a page is parsed: `[text](../path)` becomes a link into the published repository, or without one the text
    with the path of the file in it."""
    page = Path(app.env.doc2path(name))
    if page.suffix != ".md":
        return

    def shown(found: re.Match[str]) -> str:
        text, target = found[1], found[2].partition("#")[0]
        if "://" in target or not target:
            return found[0]
        file = (page.parent / target).resolve()
        if file.is_relative_to(ROOT / "docs") or not file.is_relative_to(ROOT):
            return found[0]
        path = file.relative_to(ROOT).as_posix()
        if REPOSITORY:
            return f"[{text}]({REPOSITORY}/blob/HEAD/{path})"
        return text if path in text else f"{text} (`{path}` of the repository)"

    source[0] = re.sub(r"(?<!!)\[([^\]]+)\]\(([^)\s]+)\)", shown, source[0])


def say_what_made_figures(app: Any, tree: nodes.document) -> None:
    """After a page is parsed: below each picture of docs/figures stand the command that made it and the date."""
    for image in list(tree.findall(nodes.image)):
        folder, _, name = image["uri"].rpartition("/")
        if folder.endswith("figures"):
            command, date = read_records()[name]
            caption = nodes.paragraph("", "", nodes.literal("", command), nodes.Text(f", {date}"), classes=["made"])
            image.parent.parent.insert(image.parent.parent.index(image.parent) + 1, caption)


class Docstring(SphinxDirective):
    """What a module says of itself below its first paragraph, in Markdown: equations stand where they are computed."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """The text, parsed."""
        module = importlib.import_module(self.arguments[0])
        self.env.note_dependency(module.__file__)
        return self.parse_text_to_nodes(inspect.cleandoc(module.__doc__).partition("\n\n")[2])


def setup(app: Any) -> None:
    """Called by Sphinx."""
    app.add_directive("docstring", Docstring)
    app.connect("source-read", linked_elsewhere)
    app.connect("doctree-read", say_what_made_figures)
