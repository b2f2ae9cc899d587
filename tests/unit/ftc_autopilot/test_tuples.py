"""Tuples of arrays, and with one field replaced, in compiled code as in plain Python."""

from typing import NamedTuple

import numpy as np

from ftc_autopilot.common.tuples import four, replaced, rows_of
from mavlink_defs.runtime.jit import compiled
from sitl_plant.vec3 import Vec3


class Place(NamedTuple):
    at: Vec3
    number: int
    speed: float


@compiled
def moved(place: Place, at: Vec3) -> Place:
    return replaced(place, "at", at)


@compiled
def faster(place: Place, speed: int) -> Place:
    return replaced(place, "speed", speed)


def test_one_field_is_replaced() -> None:
    place = Place((1.0, 2.0, 3.0), 7, 0.5)
    assert moved(place, (4.0, 5.0, 6.0)) == place._replace(at=(4.0, 5.0, 6.0))
    assert faster(place, 2) == place._replace(speed=2)
    assert place == Place((1.0, 2.0, 3.0), 7, 0.5)


def test_tuples_have_the_numbers_of_the_arrays() -> None:
    numbers = np.arange(12.0).reshape(4, 3)
    assert rows_of(numbers) == tuple(map(tuple, numbers.tolist()))
    assert four(numbers[:, 1].copy()) == (1.0, 4.0, 7.0, 10.0)
