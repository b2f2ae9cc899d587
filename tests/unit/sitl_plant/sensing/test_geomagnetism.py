"""The magnetic field of a place against published values."""

import numpy as np
import pytest

from mavlink_defs.origin import Origin
from sitl_plant.sensing.geomagnetism import magnetic_field

PUBLISHED = [  # WMM2025_TestValues.txt of NOAA: at 2025.0 and height 0: latitude, longitude, X Y Z
    (80.0, 0.0, 6521.6, 145.9, 54791.5),
    (0.0, 120.0, 39677.8, -109.6, -10580.2),
    (-80.0, -120.0, 6117.5, 15751.9, -52022.5),
]


@pytest.mark.parametrize(("latitude", "longitude", "x", "y", "z"), PUBLISHED)
def test_the_model_has_its_published_test_values(
    latitude: float, longitude: float, x: float, y: float, z: float
) -> None:
    origin = Origin(latitude_deg=latitude, longitude_deg=longitude, altitude_m=0.0)
    assert magnetic_field(origin) * 1e5 == pytest.approx([x, y, z], abs=0.1)


@pytest.mark.parametrize(
    ("latitude", "longitude", "height_m", "declination", "inclination", "horizontal"),
    [  # the high-resolution model has the crust, too: WMMHR2025_TEST_VALUES.txt of NOAA
        (-50.0, -103.0, 3000.0, 28.00, -54.87, 22120.9),
        (-36.0, -137.0, 6000.0, 20.28, -52.10, 25347.7),
        (-52.0, -75.0, 8000.0, 14.91, -49.69, 20005.0),
    ],
)
def test_it_is_near_another_model(
    latitude: float,
    longitude: float,
    height_m: float,
    declination: float,
    inclination: float,
    horizontal: float,
) -> None:
    origin = Origin(latitude_deg=latitude, longitude_deg=longitude, altitude_m=height_m)
    x, y, z = magnetic_field(origin) * 1e5
    assert np.degrees(np.arctan2(y, x)) == pytest.approx(declination, abs=0.5)
    assert np.degrees(np.arctan2(z, np.hypot(x, y))) == pytest.approx(inclination, abs=0.5)
    assert np.hypot(x, y) == pytest.approx(horizontal, rel=0.01)
