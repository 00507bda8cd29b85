"""Pages in headless Chromium, where there is one, without a network."""

import shutil
import subprocess

import pytest

CHROMIUM = next(
    (path for name in ("chromium", "chromium-browser", "google-chrome") if (path := shutil.which(name))), None
)
needs_browser = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here")

#: Runs before all else in the page, and collects what goes wrong.
LISTEN = """<script>
window.wrong = [];
window.addEventListener("error", (e) => window.wrong.push(String(e.message)));
console.error = console.warn = (...said) => window.wrong.push(said.join(" "));
// without a display Chromium draws frames now and then: here it draws when it is asked
window.requestAnimationFrame = (draw) => setTimeout(draw, 0);
</script>"""

#: A name that runs where it is taken for markup.
EVIL = "<img src=x onerror='window.ran=1'></script><script>window.ran=1</script>"
_RAN = "<script>setTimeout(() => { document.body.dataset.ran = String(window.ran); }, 300);</script>"


def runs(page, tmp_path):
    """Whether anything of an evil name ran."""
    assert page.count("window.ran=1") > 3
    document = opened(page.replace("</body>", _RAN + "</body>"), tmp_path)
    assert 'data-ran="1"' in document or 'data-ran="undefined"' in document
    return 'data-ran="1"' in document


def opened(page, tmp_path):
    """The document after its scripts ran."""
    path = tmp_path / "page.html"
    path.write_text(page, encoding="utf-8")
    options = (
        *("--headless", "--no-sandbox", "--disable-dev-shm-usage", f"--user-data-dir={tmp_path / 'profile'}"),
        *("--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--window-size=1200,900"),
        *("--allow-file-access-from-files", "--virtual-time-budget=8000", "--dump-dom"),
    )
    arguments = [CHROMIUM, *options, path.as_uri()]
    done = subprocess.run(arguments, capture_output=True, text=True, timeout=120, check=True)
    return done.stdout
