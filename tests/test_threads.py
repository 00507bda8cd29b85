"""Threads: as many as are said, and the same results by any number of them."""

import threading

import numpy as np
import pytest

from warpbrain.threads import MOST, beside, fill_columns, in_threads, is_working_beside, processors, thread_count


@pytest.mark.parametrize(
    ("said", "count"),
    [("1", 1), ("3", 3), ("4,2", 4), (" 5 ", 5), ("100", MOST), ("", None), ("0", None), ("-2", None), ("many", None)],
)
def test_the_environment_says_how_many(monkeypatch, said, count):
    monkeypatch.setenv("OMP_NUM_THREADS", said)
    assert thread_count() == (min(processors(), MOST) if count is None else count)


def test_without_a_word_there_is_one_for_each_processor(monkeypatch):
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    assert thread_count() == min(processors(), MOST)


def test_parts_come_back_in_their_order_from_several_threads(monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "3")
    together = threading.Barrier(3, timeout=30.0)

    def work(part: int) -> tuple[int, int]:
        together.wait()
        return part, threading.get_ident()

    found = in_threads(work, range(3))
    assert [part for part, _ in found] == [0, 1, 2]
    assert len({thread for _, thread in found}) == 3
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    assert in_threads(lambda part: threading.get_ident(), range(3)) == [threading.get_ident()] * 3


def test_parts_of_a_part_stay_in_its_thread(monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "2")

    def work(part: int) -> bool:
        return set(in_threads(lambda _: threading.get_ident(), range(3))) == {threading.get_ident()}

    assert in_threads(work, range(2)) == [True, True]


def test_what_goes_wrong_in_a_thread_is_raised(monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "2")
    with pytest.raises(ZeroDivisionError):
        in_threads(lambda part: 1 / part, [1, 0, 2])


def test_blas_has_one_thread_in_each(monkeypatch):
    import scipy.linalg  # noqa: F401
    from threadpoolctl import threadpool_info, threadpool_limits

    def threads() -> set[int]:
        return {library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"}

    monkeypatch.setenv("OMP_NUM_THREADS", "2")
    with threadpool_limits(2, user_api="blas"):
        assert in_threads(lambda part: threads(), range(2)) == [{1}, {1}]
        assert threads() == {2}


@pytest.mark.parametrize("count", ["1", "2"])
def test_something_beside_is_there_when_it_is_asked_for(monkeypatch, count):
    monkeypatch.setenv("OMP_NUM_THREADS", count)
    begun = threading.Event()

    def work() -> set[int]:
        begun.set()
        return set(in_threads(lambda _: threading.get_ident(), range(3)))

    wait = beside(work)
    assert begun.wait(0.0 if count == "1" else 30.0) == (count == "2")
    found = wait()
    # alone it is done by who asks, else in one thread of its own
    assert len(found) == 1 and (found == {threading.get_ident()}) == (count == "1")

    def fail() -> None:
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        beside(fail)()


@pytest.mark.parametrize("count", ["1", "3"])
def test_columns_are_filled_some_at_a_time(monkeypatch, count):
    monkeypatch.setenv("OMP_NUM_THREADS", count)
    found, asked = np.zeros((2, 7)), []

    def work(some: slice) -> np.ndarray:
        asked.append(some.start)
        return np.arange(7.0)[some] * [[1.0], [-1.0]]

    fill_columns(found, work, 3)
    np.testing.assert_array_equal(found, [np.arange(7.0), -np.arange(7.0)])
    assert sorted(asked) == [0, 3, 6]


def test_what_works_beside_is_known_until_it_is_done(monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "2")
    done = threading.Event()
    wait = beside(lambda: done.wait(30.0))
    assert is_working_beside()
    done.set()
    assert wait() and not is_working_beside()
