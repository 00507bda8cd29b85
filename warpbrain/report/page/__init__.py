"""How a result becomes printed lines and one page that needs no network: templates of the same dictionary, its JSON.

The macros of a text template (`run.txt`, `estimate.txt`, ...) make what is printed. A template of a page (`run.html` of
runs and tests of specimens, `estimate.html`, `diagnosis.html`) makes sections of a result, with what is said of their
figures, and the facts on top; `page` puts them below a verdict and a table of contents into the frame, with
`page.css`. Macros of `parts.html` make what pages share, those of `notebook.html` what a notebook shows; `figures`
makes still figures, `scene` with `scene.js` the view in three dimensions.
"""

import re
import textwrap
from collections.abc import Callable, Iterable, Sequence
from functools import cache
from importlib.resources import files
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined, select_autoescape
from markupsafe import Markup, escape

from warpbrain.inference.calibration import percent
from warpbrain.physics.words import tabled

#: Characters of a cell that is never broken.
_SHORT = 8
#: Characters of a printed line of prose.
_WIDTH = 110


@cache
def _environment() -> Environment:
    environment = Environment(
        loader=PackageLoader("warpbrain.report.page", "."), autoescape=select_autoescape(["html"]),
        undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    environment.filters |= {"percent": percent, "tabled": tabled, "wrapped": _wrapped}
    environment.globals |= {"table": table, "asset": asset, "lines": lines}
    return environment


def lines(template: str, macro: str, *values: Any) -> list[str]:
    """What a macro of a text template prints of values."""
    text = getattr(_environment().get_template(template).module, macro)(*values)
    return [line.rstrip() for line in text.splitlines()]


def rendered(template: str, **values: Any) -> str:
    """A whole text template of values."""
    return _environment().get_template(template).render(**values)


def _wrapped(sentence: str, following: str) -> str:
    """A sentence on lines of the width of a terminal, all but the first indented as is said."""
    return textwrap.fill(sentence, _WIDTH, initial_indent="  ", subsequent_indent=following)


def part(name: str, *values: Any, template: str = "parts.html") -> Markup:
    """A macro of a template of HTML with its values."""
    return Markup(getattr(_environment().get_template(template).module, name)(*values))


def page(
    window: str,
    title: str,
    badge: str,
    colours: tuple[str, str],
    sentences: Sequence[str],
    template: str,
    **values: Any,
) -> str:
    """A page as one HTML file: the sections that a template makes of values, whose words are no markup.

    On top stand a title, a badge with the colours of its ground and letters, sentences, and the facts that the template
    says; `window` is the title of the window. Sections without a body are left out.
    """
    sections: list[tuple[str, str, Markup]] = []
    facts: list[tuple[str, str]] = []

    def section(heading: str, caller: Callable[[], str]) -> str:
        if body := str(caller()).strip():
            anchor = re.sub(r"[^a-z0-9]+", "-", heading.lower()).strip("-")
            sections.append((anchor, heading, Markup(body)))
        return ""

    def fact(name: str, value: str) -> str:
        facts.append((name, value))
        return ""

    _environment().get_template(template).render(section=section, fact=fact, **values)
    return f"{part('frame', window, title, badge, colours, sentences, facts, sections)}\n"


def table(head: Sequence[str], rows: Iterable[Sequence[Any]], numbers: Sequence[int] = (), caption: str = "") -> Markup:
    """A table as HTML, in whose cells only `Markup` is markup; nothing of no rows.

    Columns of numbers are set to the right, columns in which nothing stands are left out.
    """
    lines = [[escape(cell) for cell in row] for row in rows]
    if not lines:
        return Markup()
    kinds = {
        # units need no room for lines, prose does
        k: "number" if k in numbers else "short" if all(len(line[k]) <= _SHORT for line in lines) else ""
        for k in range(len(head))
        if any(line[k] for line in lines)
    }
    cells = [[(kind, line[k]) for k, kind in kinds.items()] for line in lines]
    return part("table", [(kind, head[k]) for k, kind in kinds.items()], cells, caption)


def asset(name: str) -> Markup:
    """A file that lies beside this one."""
    return Markup((files("warpbrain.report.page") / name).read_text(encoding="utf-8"))
