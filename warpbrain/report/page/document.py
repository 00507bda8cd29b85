"""A page: its frame, what stands on top, a table of contents, and sections."""

from __future__ import annotations

import html
import re
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

from warpbrain.atomic import whole_file


@dataclass(frozen=True)
class Section:
    """A part of a page.

    Attributes
    ----------
    title : str
        In words.
    body : str
        HTML.
    """

    title: str
    body: str

    @property
    def anchor(self) -> str:
        """What a link of the contents goes to."""
        return re.sub(r"[^a-z0-9]+", "-", self.title.lower()).strip("-")


def section(title: str, *parts: str) -> Section:
    """A section of HTML parts, one after another."""
    return Section(title, "".join(parts))


def document(title: str, header: str, sections: Sequence[Section], badge: tuple[str, str]) -> str:
    """A page as one HTML file.

    Parameters
    ----------
    title : str
        In words, of the window.
    header : str
        HTML, see `header`.
    sections : sequence of Section
        Those without a body are left out.
    badge : tuple of str
        Colours of the ground and the letters of what is said on top.
    """
    shown = [one for one in sections if one.body]
    contents = "".join(f'<li><a href="#{one.anchor}">{text(one.title)}</a></li>' for one in shown)
    body = "".join(f'<section id="{one.anchor}"><h2>{text(one.title)}</h2>{one.body}</section>\n' for one in shown)
    ground, letters = badge
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<link rel="icon" href="data:,">
<title>{text(title)}</title>
<style>{asset("page.css")}
:root {{ --badge: {ground}; --badge-text: {letters}; }}</style>
</head>
<body>
<main>
{header}<nav aria-label="contents"><ul>{contents}</ul></nav>
{body}</main>
</body>
</html>
"""


def header(title: str, badge: str, sentences: Sequence[str], facts: Sequence[tuple[str, str]]) -> str:
    """What stands on top: whose page it is, what was found in a word and in sentences, and its numbers.

    Titles, badge and sentences are words; names and values of facts are HTML.
    """
    shown = "".join(f"<div><dt>{name}</dt><dd>{value}</dd></div>" for name, value in facts)
    said = "".join(f'<p class="sentence">{text(one)}</p>' for one in sentences)
    return (
        f'<header><h1>{text(title)}</h1><div class="verdict"><span class="badge">{text(badge)}</span>{said}'
        f'<dl class="facts">{shown}</dl></div></header>\n'
    )


def text(value: Any) -> str:
    """Words as HTML: nothing in them is markup."""
    return html.escape(str(value))


def listed(sentences: Sequence[str]) -> str:
    """Sentences as a list; nothing of none."""
    return f"<ul>{''.join(f'<li>{text(one)}</li>' for one in sentences)}</ul>" if sentences else ""


def asset(name: str) -> str:
    """A file that lies beside this one."""
    return (files("warpbrain.report.page") / name).read_text(encoding="utf-8")


def write_document(path: Path, page: str) -> None:
    """Write a page, whole."""
    with whole_file(path) as temporary:
        temporary.write_text(page, encoding="utf-8")
