"""Writes docs/mechanisms.md from the files of the mechanisms."""

from pathlib import Path

from warpbrain.report.mechanism_text import page

if __name__ == "__main__":
    (Path(__file__).parent / "mechanisms.md").write_text(page(), encoding="utf-8")
