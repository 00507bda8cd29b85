"""Colours and markers of the states of a case; in grey print the first is the darkest."""

from __future__ import annotations

from warpbrain.report.generative.page import BLUE, ORANGE, VERMILLION

COLOURS = {"declared": VERMILLION, "refitted": ORANGE, "explained": BLUE}
MARKERS = {"declared": "x", "refitted": "+", "explained": "o"}
