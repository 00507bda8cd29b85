"""The frame of every report: nothing of a user's words is markup, and its contents lead somewhere."""

import re

from warpbrain.report.page import Section, Top, document, part, table

COLOURS = ("#000", "#fff")
EVIL = '</title><script>alert("1")</script>'


def test_words_are_no_markup():
    page = document(EVIL, Top(EVIL, EVIL, COLOURS, [EVIL], []), [Section(EVIL, part("listed", [EVIL]))])
    assert "<script>" not in page and page.count("&lt;script&gt;") == 7


def test_contents_lead_to_sections_that_have_something():
    sections = [Section("Before & after", "<p>a</p>"), Section("Empty", ""), Section("What was assumed", "<p>b</p>")]
    page = document("title", Top("title", "badge", COLOURS, [], [("x", "1 mm")]), sections)
    links = re.findall(r'<a href="#([^"]*)">', page)
    assert links == ["before-after", "what-was-assumed"] == re.findall(r'<section id="([^"]*)">', page)
    assert "Empty" not in page


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
