import math
import struct

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from mavlink_defs.float32 import decimal_of_float32, float32s


def as_float32(x: float) -> float:
    return struct.unpack("<f", struct.pack("<f", x))[0]


@pytest.mark.parametrize("x", [0.9, 0.1, -25.0, 1e-7, 123456.0, 0.333333, 16777216.0, 1.5e-45])
def test_short_decimals_come_back(x: float) -> None:
    restored = decimal_of_float32(as_float32(x))
    assert restored == pytest.approx(x, rel=0.1)
    assert as_float32(restored) == as_float32(x)


def test_09_comes_back_as_09() -> None:
    assert as_float32(0.9) != 0.9
    assert decimal_of_float32(as_float32(0.9)) == 0.9


@given(st.integers(-999_999, 999_999), st.integers(-30, 30))
def test_six_significant_digits_pass_unchanged(digits: int, exponent: int) -> None:
    decimal = float(f"{digits}e{exponent}")
    assert decimal_of_float32(as_float32(decimal)) == decimal


@given(st.floats(width=32))
def test_no_float32_is_changed(x: float) -> None:
    restored = decimal_of_float32(x)
    assert struct.pack("<f", restored) == struct.pack("<f", x) or math.isnan(x)
    assert math.isnan(restored) == math.isnan(x)


@pytest.mark.parametrize("x", [math.inf, -math.inf])
def test_infinity_is_preserved(x: float) -> None:
    assert decimal_of_float32(x) == x


def test_beyond_float32_is_infinite() -> None:
    assert decimal_of_float32(1e300) == math.inf
    assert decimal_of_float32(1e-300) == 0.0


def test_sign_of_zero_is_preserved() -> None:
    assert math.copysign(1.0, decimal_of_float32(-0.0)) == -1.0


INFINITE_FROM = math.ldexp(1.0 - 2.0**-25, 128)  # rounds to a power of two, which none holds


@given(st.lists(st.floats() | st.floats(width=32), max_size=9))
@example([math.inf, -math.inf, 1e300, -1e300, math.nextafter(INFINITE_FROM, 0.0), INFINITE_FROM])
@example([0.0, -0.0, 1e-45, -1e-42, 7e-46, 1e-300, -1e-300, math.nan, math.copysign(math.nan, -1)])
def test_fields_hold_what_numpy_rounds_to(values: list[float]) -> None:
    with np.errstate(over="ignore", under="ignore"):
        rounded = np.array(values, np.float64).astype("<f4")
    fields = float32s(values)
    assert struct.pack(f"<{len(fields)}f", *fields) == rounded.tobytes()
    assert float32s(np.array(values, np.float64)) == pytest.approx(fields, rel=0.0, nan_ok=True)
