"""The standard atmosphere against its published tables, and its inverse."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sitl_plant.sensing.standard_air import altitude_of, pressure_at, temperature_at

TABLE = [  # ISO 2533:1975, geopotential altitude [m], temperature [K], pressure [hPa]
    (0.0, 288.15, 1013.25),
    (1000.0, 281.65, 898.746),
    (5000.0, 255.65, 540.199),
    (11_000.0, 216.65, 226.321),
    (15_000.0, 216.65, 120.446),
]


@pytest.mark.parametrize(("altitude", "kelvin", "pressure"), TABLE)
def test_the_published_table(altitude: float, kelvin: float, pressure: float) -> None:
    assert pressure_at(altitude) == pytest.approx(pressure, rel=5e-5)
    assert temperature_at(altitude) == pytest.approx(kelvin - 273.15, abs=1e-9)


@given(st.floats(-2000.0, 20_000.0))
def test_the_altitude_of_a_pressure_is_that_of_the_pressure(altitude: float) -> None:
    assert altitude_of(pressure_at(altitude)) == pytest.approx(altitude, abs=1e-6)
