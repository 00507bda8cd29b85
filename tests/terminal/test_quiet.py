"""A home that cannot be written to: what to do about it is said in one line."""

import warp as wp
from command import warpbrain
from folders import write_folder


def test_a_home_that_cannot_be_written_to(tmp_path, monkeypatch):
    def no_place():
        raise OSError(30, "Read-only file system", "/home/me/.cache/warp")

    monkeypatch.setattr(wp, "init", no_place)
    ran = warpbrain("run", "--case", write_folder(tmp_path / "case"), "--out", tmp_path / "out")
    assert ran.status == 1
    assert ran.err == (
        "warpbrain: /home/me/.cache/warp: kernels cannot be kept there (Read-only file system): "
        "set WARP_CACHE_PATH to a folder that can be written to\n"
    )
    assert not (tmp_path / "out").exists()
