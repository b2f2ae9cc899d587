"""Configuration of what an aircraft stands on and starts from, and of the ground itself.

A file says as little as `gear: {kind: tricycle}`: places are then shares of the wing span, springs
follow from the weight and the static deflection, limits from the wing loading. Body axes are
x forward, y right, z down, from the centre of gravity.
"""

import math
from collections.abc import Iterator
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from pydantic import model_validator

from mavlink_defs.config.models import Model, Problems
from mavlink_defs.config.quantity import quantity

_Along = Annotated[float, quantity("m", "Place along a body axis.", ge=-100.0, le=100.0)]
_Place = tuple[_Along, _Along, _Along]

_RESERVE = 1.2
"""Sink rate at which the gear breaks by the one that it is designed for: CS-23.727."""


class _Shape(NamedTuple):
    """Defaults of a kind of gear; places as shares of the wing span."""

    main: tuple[float, float, float]
    third: tuple[float, float, float]
    nose: tuple[float, float, float]
    deflection: float  # static, as a share of the height of the centre of gravity
    rolling_friction: float
    side_friction: float
    brake_friction: float
    steer_deg: float


_ON_WHEELS: dict[str, Any] = {
    "nose": (0.25, 0.0, 0.04),
    "deflection": 0.1,
    "rolling_friction": 0.03,
    "side_friction": 0.6,
    "brake_friction": 0.4,
    "steer_deg": 20.0,
}
_SHAPES = {
    "tricycle": _Shape(main=(-0.03, 0.125, 0.11), third=(0.17, 0.0, 0.11), **_ON_WHEELS),
    "tailwheel": _Shape(main=(0.04, 0.125, 0.12), third=(-0.42, 0.0, 0.05), **_ON_WHEELS),
    "belly": _Shape(
        main=(-0.06, 0.04, 0.06),
        third=(0.12, 0.0, 0.06),
        nose=(0.25, 0.0, 0.0),
        deflection=0.05,
        rolling_friction=0.4,
        side_friction=0.4,
        brake_friction=0.4,
        steer_deg=0.0,
    ),
}


class Launcher(Model):
    """A hand or a rail, which throws the aircraft into the air along its x axis.

    It lets go once more than half of the largest thrust is commanded.

    Attributes:
        speed_m_s: Speed over the ground at its end.
        pitch_deg: Pitch angle.
        length_m: Way along which it accelerates.
        height_m: Height of the centre of gravity above the ground, at its start.
    """

    speed_m_s: float = quantity("m/s", gt=0.0, le=300.0)
    pitch_deg: float = quantity("deg", default=10.0, ge=0.0, le=60.0)
    length_m: float = quantity("m", default=2.0, gt=0.0, le=100.0)
    height_m: float = quantity("m", default=1.5, gt=0.0)


class Gear(Model):
    """What the aircraft touches the ground with: three wheels, or three points of its belly.

    Attributes:
        kind: Main wheels and a nose wheel, or a tail wheel; or a belly with a keel.
        main_m: Place of the right main wheel, of the left one mirrored [m].
        third_m: Place of the nose or tail wheel, or of the keel's front [m].
        wing_tip_m: Place of the right wing tip, of the left one mirrored [m].
        nose_m: Lowest place of the nose, a propeller's perhaps [m].
        tail_m: Place of the tail [m].
        static_deflection_m: How far wheels give way under the weight; none: 10 % of the height, 5 %
            of a belly's.
        damping_ratio: Damping of the heave on them as a share of the critical one.
        rolling_friction: Friction of rolling wheels, or of a belly; none: 0.03, or 0.4.
        side_friction: Friction of wheels, or of a belly, across; none: 0.6, or 0.4.
        brake_friction: Friction of the main wheels at full brake; none: 0.4.
        steer_deg: Angle of the nose or tail wheel at the rudder's stop; none: 20, or 0 of a belly.
        sink_hard_m_s: Sink rate above which a landing is a hard one; none: 4.4 (W/S)^1/4 of
            CS-23.473.
        sink_max_m_s: Sink rate above which it is a crash; none: 1.2 times sink_hard_m_s.
        bank_max_deg: Bank at touchdown above which it is a crash; none: any.
        drift_max_m_s: Speed across at touchdown above which it is a crash; none: any.
        launcher: What it starts from; none: from its wheels.
    """

    kind: Literal["tricycle", "tailwheel", "belly"]
    main_m: _Place | None = None
    third_m: _Place | None = None
    wing_tip_m: _Place | None = None
    nose_m: _Place | None = None
    tail_m: _Place | None = None
    static_deflection_m: float | None = quantity("m", default=None, gt=0.0, le=1.0)
    damping_ratio: float = quantity("", default=0.7, ge=0.05, le=2.0)
    rolling_friction: float | None = quantity("", default=None, ge=0.0, le=2.0)
    side_friction: float | None = quantity("", default=None, ge=0.0, le=2.0)
    brake_friction: float | None = quantity("", default=None, ge=0.0, le=2.0)
    steer_deg: float | None = quantity("deg", default=None, ge=0.0, le=80.0)
    sink_hard_m_s: float | None = quantity("m/s", default=None, gt=0.0)
    sink_max_m_s: float | None = quantity("m/s", default=None, gt=0.0)
    bank_max_deg: float | None = quantity("deg", default=None, gt=0.0, le=90.0)
    drift_max_m_s: float | None = quantity("m/s", default=None, gt=0.0)
    launcher: Launcher | None = None

    @model_validator(mode="after")
    def _in_order(self) -> "Gear":
        if self.main_m is not None and self.main_m[1] <= 0.0:
            text = f"expected the right one, y > 0 m, got {self.main_m[1]:g}"
            raise Problems([(("main_m",), text)])
        hard, most = self.sink_hard_m_s, self.sink_max_m_s
        if hard is not None and most is not None and most < hard:
            raise Problems([(("sink_max_m_s",), f"expected >= sink_hard_m_s = {hard!r} m/s")])
        return self

    def standing_problems(self, span_m: float) -> Iterator[str]:
        """Yield why an aircraft with a wing span [m] cannot stand on it."""
        main, third = self.main(span_m), self.third(span_m)
        behind, ahead = self.arms(span_m) if main[0] != third[0] else (0.0, 0.0)
        if behind * ahead >= 0.0:
            yield (
                "expected main_m and third_m on both sides of the centre of gravity, so that it "
                f"stands, got {behind:.3g} and {ahead:.3g} m before it"
            )
            return
        slope = (third[2] - main[2]) / (third[0] - main[0])
        names = ("wing_tip_m", "nose_m", "tail_m", "the centre of gravity")
        for name, (x, _, z) in zip(names, (*self.hull(span_m), (0.0, 0.0, 0.0)), strict=True):
            clearance = main[2] + slope * (x - main[0]) - z
            if clearance <= 2.0 * self.deflection(span_m):
                yield (
                    f"expected {name} above the ground at rest, by two static deflections of "
                    f"{self.deflection(span_m):.3g} m, got {clearance:.3g} m"
                )
                return

    def arms(self, span_m: float) -> tuple[float, float]:
        """Return how far main and third wheel are before the centre of gravity, at rest [m]."""
        main, third = self.main(span_m), self.third(span_m)
        pitch = math.atan((main[2] - third[2]) / (main[0] - third[0]))
        c, s = math.cos(pitch), math.sin(pitch)
        return c * main[0] + s * main[2], c * third[0] + s * third[2]

    def main(self, span_m: float) -> tuple[float, float, float]:
        """Return the place of the right main wheel of an aircraft with a wing span [m]."""
        return self.main_m or _scaled(self._shape.main, span_m)

    def third(self, span_m: float) -> tuple[float, float, float]:
        """Return the place of the nose or tail wheel, or of the keel's front [m]."""
        return self.third_m or _scaled(self._shape.third, span_m)

    def hull(self, span_m: float) -> tuple[tuple[float, float, float], ...]:
        """Return the places of the right wing tip, the nose and the tail [m]."""
        return (
            self.wing_tip_m or (0.0, 0.5 * span_m, 0.0),
            self.nose_m or _scaled(self._shape.nose, span_m),
            self.tail_m or (-0.45 * span_m, 0.0, 0.0),
        )

    def deflection(self, span_m: float) -> float:
        """Return the static deflection [m]."""
        return self.static_deflection_m or self._shape.deflection * self.main(span_m)[2]

    @property
    def frictions(self) -> tuple[float, float, float]:
        """Friction of rolling, across, and at full brake."""
        shape = self._shape
        given = (self.rolling_friction, self.side_friction, self.brake_friction)
        defaults = (shape.rolling_friction, shape.side_friction, shape.brake_friction)
        rolling, side, brake = (d if g is None else g for g, d in zip(given, defaults, strict=True))
        return rolling, side, max(rolling, brake)

    @property
    def steer(self) -> float:
        """Angle of the steered wheel at the rudder's stop [rad]."""
        return math.radians(self._shape.steer_deg if self.steer_deg is None else self.steer_deg)

    def sinks(self, wing_loading_n_m2: float) -> tuple[float, float]:
        """Return the sink rates above which a landing is hard, and a crash [m/s].

        CS-23.473(d): 4.4 (W/S)^1/4 ft/s with lb/ft², and within 7 and 10 ft/s.
        """
        designed = min(max(4.4 * (wing_loading_n_m2 / 47.88) ** 0.25, 7.0), 10.0) * 0.3048
        hard = self.sink_hard_m_s or min(designed, self.sink_max_m_s or math.inf)
        return hard, self.sink_max_m_s or _RESERVE * hard

    @property
    def _shape(self) -> _Shape:
        return _SHAPES[self.kind]


class Ground(Model):
    """The ground: a plane through the origin.

    Attributes:
        slope_deg: How steep it is.
        uphill_deg: Direction, from north to east, in which it rises.
    """

    slope_deg: float = quantity("deg", default=0.0, ge=0.0, le=20.0)
    uphill_deg: float = quantity("deg", default=0.0, ge=-360.0, le=360.0)

    @property
    def normal(self) -> np.ndarray:
        """Unit vector into the ground, NED."""
        slope, uphill = math.radians(self.slope_deg), math.radians(self.uphill_deg)
        across = math.sin(slope)
        return np.array([across * math.cos(uphill), across * math.sin(uphill), math.cos(slope)])

    def altitude_m(self, north_m: float, east_m: float) -> float:
        """Return how high the ground is above the origin [m] at a place [m]."""
        north, east, down = self.normal.tolist()
        return float((north * north_m + east * east_m) / down)


class Runway(Model):
    """A runway on the ground: a rectangle from its threshold on.

    Attributes:
        north_m: North of the middle of its threshold.
        east_m: East of the middle of its threshold.
        heading_deg: Heading along it.
        length_m: Length.
        width_m: Width.
    """

    north_m: float = quantity("m", default=0.0)
    east_m: float = quantity("m", default=0.0)
    heading_deg: float = quantity("deg", ge=-360.0, le=360.0)
    length_m: float = quantity("m", gt=0.0, le=10_000.0)
    width_m: float = quantity("m", gt=0.0, le=1000.0)

    def along_and_across(
        self, north_m: float | np.ndarray, east_m: float | np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return how far behind the threshold, and right of the centre line, places are [m]."""
        heading = math.radians(self.heading_deg)
        north, east = np.asarray(north_m) - self.north_m, np.asarray(east_m) - self.east_m
        c, s = math.cos(heading), math.sin(heading)
        return c * north + s * east, c * east - s * north

    def holds(self, north_m: float | np.ndarray, east_m: float | np.ndarray) -> np.ndarray:
        """Return whether places are on it."""
        along, across = self.along_and_across(north_m, east_m)
        is_beside = np.abs(across) > self.width_m / 2.0
        return np.asarray(~((along < 0.0) | (along > self.length_m) | is_beside))


def _scaled(shares: tuple[float, float, float], span_m: float) -> tuple[float, float, float]:
    return shares[0] * span_m, shares[1] * span_m, shares[2] * span_m
