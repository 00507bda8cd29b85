"""The frame of every report: nothing of a user's words is markup, and its contents lead somewhere."""

import re

from warpbrain.report.page import _environment, page, part, table

COLOURS = ("#000", "#fff")
EVIL = '</title><script>alert("1")</script>'


def test_words_are_no_markup():
    template = "{{ fact(evil, evil) }}{% call section(evil) %}{{ evil }}{{ listed }}{% endcall %}"
    values = {"evil": EVIL, "listed": part("listed", [EVIL])}
    text = page(EVIL, EVIL, EVIL, COLOURS, [EVIL], _environment().from_string(template), **values)
    assert "<script>" not in text and text.count("&lt;script&gt;") == 10


def test_contents_lead_to_sections_that_have_something():
    bodies = {"Before & after": "<p>a</p>", "Empty": "", "What was assumed": "<p>b</p>"}
    sections = [f'{{% call section("{title}") %}}{body}{{% endcall %}}' for title, body in bodies.items()]
    text = page("title", "title", "badge", COLOURS, [], _environment().from_string("".join(sections)))
    links = re.findall(r'<a href="#([^"]*)">', text)
    assert links == ["before-after", "what-was-assumed"] == re.findall(r'<section id="([^"]*)">', text)
    assert "Empty" not in text


def test_a_column_in_which_nothing_stands_is_left_out():
    page = table(("name", "check", "role"), [["a", "", "fit"], ["b", "", ""]], numbers=(1, 2))
    assert "check" not in page and "role" in page
    # all rows have as many cells as there are heads
    assert page.count("<th ") == 2 and page.count("<td") == 4 and page.count('class="number"') == 3


def test_a_filled_column_stays_where_it_is():
    page = table(("name", "check"), [["a", ""], ["b", "1.0"]], numbers=(1,))
    assert re.findall(r"<td[^>]*>(.*?)</td>", page) == ["a", "", "b", "1.0"]


def test_what_stands_above_a_table_does_not_scroll_with_it():
    page = table(("name", "unit"), [["a", "mm"], ["b", "mm"]], caption="Root mean square")
    above, scrolling = page.split('<div class="wide"')
    assert above == '<p class="note">Root mean square</p>' and 'aria-label="Root mean square"' in scrolling
    # units need no room for lines, prose does
    assert page.count('class="short"') == 6
    assert 'class="short"' not in table(("why",), [["mm"], ["a sentence of many words"]])
