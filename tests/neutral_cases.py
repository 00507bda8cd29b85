"""A case of the challenge made of numbers."""

import numpy as np

from referee.challenge.neutral import NeutralCase

CAUSES = ("gravity", "pressure", "swelling", "swelling")


def neutral(seed=3, points=40, sigma=0.3e-3):
    """Points in a cube of 10 cm, a rigid shift, four causes of columns at random; nothing acts."""
    random = np.random.default_rng(seed)
    place = np.repeat(0.1 * random.random((points, 3)), 3, axis=0)
    rows = len(place)
    direction = np.tile(np.eye(3), (points, 1))
    nuisance = 1e-3 * direction
    columns = sigma * random.normal(size=(rows, len(CAUSES))) / np.sqrt(rows)
    columns *= 3.0
    predicted = 1e-3 * random.normal(size=rows)
    recorded = predicted + sigma * random.normal(size=rows) + nuisance @ random.normal(size=3)
    return NeutralCase(
        name="made",
        sensor_place=place,
        sensor_direction=direction,
        sensor_kind=np.full(rows, "displacement"),
        sensor_point=np.repeat(np.arange(points), 3),
        sensor_time=np.full(rows, np.nan),
        recorded=recorded,
        predicted=predicted,
        sigma_declared=True,
        noise_covariance=sigma**2 * np.eye(rows),
        nuisance_name=np.full(3, "shift"),
        nuisance_response=nuisance,
        cause_name=np.array(CAUSES),
        cause_candidate=np.arange(len(CAUSES)),
        cause_place=np.full((len(CAUSES), 3), np.nan),
        cause_length=np.full(len(CAUSES), np.nan),
        cause_amount=np.ones(len(CAUSES)),
        cause_unit=np.full(len(CAUSES), "1"),
        cause_response=columns,
        site_place=place[:3],
        site_response=1e-3 * random.normal(size=(rows, 3, 3)),
    )
