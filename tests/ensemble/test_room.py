"""Room for results: what is taken is whole, nobody else's, and there whether it was made ready or not."""

import numpy as np

from warpbrain.ensemble.batch import ResultRoom


def test_room_is_of_one_taker() -> None:
    room, random = ResultRoom(5, 4), np.random.default_rng(8)
    taken, kept = [], []
    for count in (3, 1, 2, 0, 4, 6, 1):
        if random.random() < 0.7:
            room.prepare()
        taken.append(room.take(count))
        assert taken[-1].shape == (count, 5, 3)
        taken[-1][:] = random.random(taken[-1].shape)
        kept.append(taken[-1].copy())
    for now, then in zip(taken, kept, strict=True):
        np.testing.assert_array_equal(now, then)
