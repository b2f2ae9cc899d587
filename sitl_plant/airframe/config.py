"""Configuration of an aircraft: of a plant the true one, of a controller the nominal one.

Symbols are the paper's of section II-A and Table I; every bound is declared here, once.
"""

import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Discriminator, Field, Tag, ValidationError, model_validator

from mavlink_defs.config.files import problems_of
from mavlink_defs.config.models import AtMost, Model, Problems, Prose, unknown_key
from mavlink_defs.config.quantity import quantity
from mavlink_defs.constants import SURFACES
from mavlink_defs.faults.kinds import FaultLimits
from mavlink_defs.profile import AirspeedLimits
from sitl_plant.airframe.gear import Gear
from sitl_plant.airframe.propulsion import Propulsion

_ROUNDING = 1e-3
"""Moments with three digits or more, of a flat body: the largest is the sum of the others."""


class Inertia(Model):
    """Moments and product of inertia, eq. (5); the other two products are zero.

    Attributes:
        Jxx: Moment of inertia about x.
        Jyy: Moment of inertia about y.
        Jzz: Moment of inertia about z.
        Jxz: Product of inertia.
    """

    Jxx: float = quantity("kg m^2", gt=0.0)
    Jyy: float = quantity("kg m^2", gt=0.0)
    Jzz: float = quantity("kg m^2", gt=0.0)
    Jxz: float = quantity("kg m^2")

    @model_validator(mode="after")
    def _positive_definite(self) -> "Inertia":
        limit = self.Jxx**0.5 * self.Jzz**0.5
        if abs(self.Jxz) >= limit:
            text = (
                "not positive definite: expected |Jxz| < sqrt(Jxx Jzz) = "
                f"{limit:.6g} kg m^2, got {self.Jxz!r}"
            )
            raise Problems([(("Jxz",), text)])
        return self

    @property
    def principal(self) -> tuple[float, float, float]:
        """Principal moments of inertia [kg m^2], in ascending order."""
        mean, radius = (self.Jxx + self.Jzz) / 2.0, math.hypot((self.Jxx - self.Jzz) / 2, self.Jxz)
        least, middle, largest = sorted((mean - radius, self.Jyy, mean + radius))
        return least, middle, largest

    @property
    def of_rigid_body(self) -> bool:
        """Whether a rigid body can have it, to the rounding of published figures.

        Along the axis of any principal moment, the sum of the others less this one is twice the
        integral of a squared coordinate over the mass, so not negative.
        """
        *others, largest = self.principal
        return largest <= (1.0 + _ROUNDING) * sum(others)


class Coefficients(Model):
    """Aerodynamic coefficients and derivatives; angles in rad, names as in Table I.

    Those beyond the paper's are 0 unless given: it has no drag but a constant, and no forces of
    surfaces and rates.

    Attributes:
        cL0: Lift at zero angle of attack.
        cL_alpha: Lift due to angle of attack.
        cD0: Drag.
        cY_beta: Side force due to sideslip.
        cl0: Rolling moment.
        cl_beta: Rolling moment due to sideslip.
        cl_p: Rolling moment due to roll rate.
        cl_r: Rolling moment due to yaw rate.
        cl_da: Rolling moment due to aileron.
        cl_dr: Rolling moment due to rudder.
        cm0: Pitching moment.
        cm_alpha: Pitching moment due to angle of attack.
        cm_q: Pitching moment due to pitch rate.
        cm_de: Pitching moment due to elevator.
        cn0: Yawing moment.
        cn_beta: Yawing moment due to sideslip.
        cn_p: Yawing moment due to roll rate.
        cn_r: Yawing moment due to yaw rate.
        cn_da: Yawing moment due to aileron.
        cn_dr: Yawing moment due to rudder.
        cL_q: Lift due to pitch rate.
        cL_de: Lift due to elevator.
        cD_alpha: Drag due to angle of attack.
        cD_alpha2: Drag due to its square.
        cD_beta: Drag due to sideslip.
        cD_beta2: Drag due to its square.
        cD_de: Drag due to elevator.
        cD_de2: Drag due to its square.
        cY0: Side force.
        cY_p: Side force due to roll rate.
        cY_r: Side force due to yaw rate.
        cY_da: Side force due to aileron.
        cY_dr: Side force due to rudder.
    """

    cL0: float = quantity("")
    cL_alpha: float = quantity("1/rad")
    cD0: float = quantity("", ge=0.0)
    cY_beta: float = quantity("1/rad")
    cl0: float = quantity("")
    cl_beta: float = quantity("1/rad")
    cl_p: float = quantity("1/rad")
    cl_r: float = quantity("1/rad")
    cl_da: float = quantity("1/rad")
    cl_dr: float = quantity("1/rad")
    cm0: float = quantity("")
    cm_alpha: float = quantity("1/rad")
    cm_q: float = quantity("1/rad")
    cm_de: float = quantity("1/rad")
    cn0: float = quantity("")
    cn_beta: float = quantity("1/rad")
    cn_p: float = quantity("1/rad")
    cn_r: float = quantity("1/rad")
    cn_da: float = quantity("1/rad")
    cn_dr: float = quantity("1/rad")
    # beyond Table I
    cL_q: float = quantity("1/rad", default=0.0)
    cL_de: float = quantity("1/rad", default=0.0)
    cD_alpha: float = quantity("1/rad", default=0.0)
    cD_alpha2: float = quantity("1/rad^2", default=0.0)
    cD_beta: float = quantity("1/rad", default=0.0)
    cD_beta2: float = quantity("1/rad^2", default=0.0)
    cD_de: float = quantity("1/rad", default=0.0)
    cD_de2: float = quantity("1/rad^2", default=0.0)
    cY0: float = quantity("", default=0.0)
    cY_p: float = quantity("1/rad", default=0.0)
    cY_r: float = quantity("1/rad", default=0.0)
    cY_da: float = quantity("1/rad", default=0.0)
    cY_dr: float = quantity("1/rad", default=0.0)

    def without_side_force(self) -> "Coefficients":
        """Return them with a side force that says nothing of sideslip."""
        return self.model_copy(update={"cY_beta": 0.0})


_FACTORS = {
    "cL": "alpha q de",
    "cD": "alpha alpha2 beta beta2 de de2",
    "cY": "beta p r da dr",
    "cl": "beta p r da dr",
    "cm": "alpha q de",
    "cn": "beta p r da dr",
}
TERMS = {
    name: {f"{name}0": "1"} | {f"{name}_{factor}": factor for factor in factors.split()}
    for name, factors in _FACTORS.items()
}
"""What each coefficient of a force or moment is multiplied by; "alpha2" is a square, p, q and r are
nondimensional."""


_NONE_SUCH = "none"


def _has_stops(value: object) -> str | None:
    """Return the tag of one angle for both stops, of two, or of no surface."""
    if isinstance(value, list | tuple):
        return "<stops>"
    if value == _NONE_SUCH:
        return "<none>"
    number = isinstance(value, int | float) and not isinstance(value, bool)
    return "<angle>" if number else None


def _on_both_sides(stops: tuple[float, float]) -> tuple[float, float]:
    if not stops[0] < 0.0 < stops[1]:
        text = f"expected a negative and a positive angle [deg], got {list(stops)!r}"
        raise ValueError(text)
    return stops


_Angle = Annotated[float, quantity("deg", "Stop on both sides.", gt=0.0, lt=90.0)]
_Stop = Annotated[float, quantity("deg", "Least or largest angle.", gt=-90.0, lt=90.0)]
_Stops = Annotated[
    Annotated[_Angle, Tag("<angle>")]
    | Annotated[tuple[_Stop, _Stop], AfterValidator(_on_both_sides), Tag("<stops>")]
    | Annotated[Literal["none"], Tag("<none>")],
    Discriminator(_has_stops),
]


class SurfaceLimits(Model):
    """Stops of each surface: `[least, largest]`, one angle for both sides, or `none`.

    `none` means that the aircraft has no such surface; its derivatives then count as 0.

    Attributes:
        aileron: Of the aileron [deg].
        elevator: Of the elevator [deg].
        rudder: Of the rudder [deg].
    """

    aileron: _Stops | None = None
    elevator: _Stops | None = None
    rudder: _Stops | None = None


class Aircraft(Model):
    """One aircraft type; of a plant the true one, of a controller the nominal one.

    Attributes:
        source: Where the numbers are from.
        mass_kg: Mass m.
        wing_area_m2: Reference area S.
        wing_span_m: Wing span b.
        mean_chord_m: Mean aerodynamic chord c.
        air_density_kg_m3: Air density rho.
        gravity_m_s2: Acceleration of gravity g.
        inertia_kg_m2: Inertia J.
        any_inertia: Whether to fly an inertia that no rigid body can have, as some publish.
        coefficients: Aerodynamic coefficients.
        rate_derivatives: Whether cl_p and the like are per p b/2V, or per rad/s.
        stall_deg: Angle of attack of the stall; none: no stall.
        stall_sharpness: Sharpness M of the blend from attached flow to a flat plate at the stall.
        thrust_limit_n: Thrust is within 0 and this.
        propulsion: Thrust by airspeed, its lag and moments; none: any at once.
        surface_limit_deg: Stop on both sides of all surfaces.
        surface_limits_deg: Stops of single surfaces, in place of it [deg].
        gear: What it touches the ground with; none: a touch ends its flight.
        airspeed_min_m_s: Lowest airspeed command accepted.
        airspeed_max_m_s: Highest airspeed command accepted.
        cruise_m_s: Airspeed that a design is for; none: mid-range.
    """

    source: Prose = ""
    mass_kg: float = quantity("kg", gt=0.0)
    wing_area_m2: float = quantity("m^2", gt=0.0)
    wing_span_m: float = quantity("m", gt=0.0)
    mean_chord_m: float = quantity("m", gt=0.0)
    air_density_kg_m3: float = quantity("kg/m^3", gt=0.0)
    gravity_m_s2: float = quantity("m/s^2", ge=0.0)
    inertia_kg_m2: Inertia
    any_inertia: bool = Field(default=False, strict=True)
    coefficients: Coefficients
    rate_derivatives: Literal["nondimensional", "per_rad_s"] = "nondimensional"
    stall_deg: float | None = quantity("deg", default=None, gt=0.0, lt=90.0)
    stall_sharpness: float = quantity("1/rad", default=50.0, gt=0.0, le=200.0)
    thrust_limit_n: float = quantity("N", gt=0.0)
    propulsion: Propulsion | None = None
    surface_limit_deg: float | None = quantity("deg", default=None, gt=0.0, lt=90.0)
    surface_limits_deg: SurfaceLimits = SurfaceLimits()
    gear: Gear | None = None
    airspeed_min_m_s: float = quantity("m/s", gt=0.0)
    airspeed_max_m_s: float = quantity("m/s", gt=0.0)
    cruise_m_s: float | None = quantity("m/s", default=None, gt=0.0)

    @model_validator(mode="after")
    def _airspeeds_in_order(self) -> "Aircraft":
        low, high = self.airspeed_min_m_s, self.airspeed_max_m_s
        if high <= low:
            text = f"expected > airspeed_min_m_s = {low!r} m/s, got {high!r}"
            raise Problems([(("airspeed_max_m_s",), text)])
        if self.cruise_m_s is not None and not low <= self.cruise_m_s <= high:
            text = f"expected [{low:g}, {high:g}] m/s, the aircraft's limits"
            raise Problems([(("cruise_m_s",), f"{text}, got {self.cruise_m_s!r}")])
        return self

    @model_validator(mode="after")
    def _inertia_of_a_rigid_body(self) -> "Aircraft":
        if not (self.any_inertia or self.inertia_kg_m2.of_rigid_body):
            least, middle, largest = self.inertia_kg_m2.principal
            text = (
                "no rigid body has it: expected the largest principal moment to be at most the sum "
                f"of the others, {least + middle:.4g} kg m^2, got {largest:.4g} kg m^2; check "
                "numbers and unit, or add 'any_inertia: true' to the aircraft to fly it as it is"
            )
            raise Problems([(("inertia_kg_m2",), text)])
        return self

    @model_validator(mode="after")
    def _stands_on_its_gear(self) -> "Aircraft":
        if self.gear is None:
            return self
        if self.gravity_m_s2 == 0.0:
            text = "expected > 0 m/s^2 of an aircraft with gear, which stands by its weight"
            raise Problems([(("gravity_m_s2",), f"{text}, got {self.gravity_m_s2!r}")])
        for text in self.gear.standing_problems(self.wing_span_m):
            raise Problems([(("gear",), text)])
        return self

    @model_validator(mode="after")
    def _every_surface_has_stops(self) -> "Aircraft":
        own = self.surface_limits_deg
        missing = [name for name in SURFACES if getattr(own, name) is None]
        if self.surface_limit_deg is None and missing:
            text = "missing; expected the stop of all surfaces [deg], or surface_limits_deg of each"
            if len(missing) < len(SURFACES):
                names = " and ".join(missing)
                text = f"missing; expected it, or the stops of {names} in surface_limits_deg"
            raise Problems([(("surface_limit_deg",), text)])
        return self

    def has(self, surface: str) -> bool:
        """Return whether the aircraft has a surface."""
        return bool(getattr(self.surface_limits_deg, surface) != _NONE_SUCH)

    @property
    def stops_deg(self) -> tuple[tuple[float, float], ...]:
        """Least and largest angle of aileron, elevator and rudder [deg]; 0 of one it has not."""
        own = self.surface_limits_deg
        return tuple(_stops(getattr(own, name), self.surface_limit_deg) for name in SURFACES)

    @property
    def design_airspeed(self) -> float:
        """Airspeed that a design is for [m/s]: cruise, or amid the range."""
        return self.cruise_m_s or (self.airspeed_min_m_s + self.airspeed_max_m_s) / 2.0

    @property
    def airspeed_limits(self) -> AirspeedLimits:
        """Range of airspeed commands accepted."""
        return AirspeedLimits(self.airspeed_min_m_s, self.airspeed_max_m_s)

    @property
    def fault_limits(self) -> FaultLimits:
        """Ranges of its actuators."""
        return FaultLimits(self.stops_deg, self.thrust_limit_n)


def _stops(own: Any, of_all: float | None) -> tuple[float, float]:
    """Return the stops of a surface, its own as in `SurfaceLimits`, or the stop of all."""
    stops = of_all if own is None else own
    if isinstance(stops, tuple | list):
        return float(stops[0]), float(stops[1])
    if stops == _NONE_SUCH:
        return 0.0, 0.0
    return -float(stops or 0.0), float(stops or 0.0)


def limits_in(aircraft: Mapping[str, Any]) -> FaultLimits:
    """Return the ranges of the actuators in an aircraft's plain data, which is not checked yet."""
    own, of_all = aircraft.get("surface_limits_deg") or {}, aircraft.get("surface_limit_deg")
    stops = tuple(_stops(own.get(name), of_all) for name in SURFACES)
    return FaultLimits(stops, aircraft["thrust_limit_n"])


_Factor = Annotated[float, quantity("", "Ratio of true to nominal value.")]
_Scale = Annotated[float, quantity("", "Ratio of true to nominal value.", gt=0.0)]
_ByName = Annotated[dict[str, _Factor], AtMost(100), Tag("<names>")]


def _form(value: object) -> str | None:
    """Return the tag of one factor for all, or of factors by name."""
    if isinstance(value, dict):
        return "<names>"
    number = isinstance(value, int | float) and not isinstance(value, bool)
    return "<all>" if number else None


class Uncertainty(Model):
    """Modelling uncertainty: true value = factor * nominal value, factors 1 unless given.

    One factor of the inertia scales it as a whole, so that it stays positive definite.

    Attributes:
        mass: Factor of the mass.
        inertia: One factor, or factors by name: Jxx, ...
        coefficients: One factor, or factors by name: cL0, ...
    """

    mass: float = quantity("", default=1.0, gt=0.0)
    inertia: Annotated[Annotated[_Scale, Tag("<all>")] | _ByName, Discriminator(_form)] = Field(
        default={}
    )
    coefficients: Annotated[Annotated[_Factor, Tag("<all>")] | _ByName, Discriminator(_form)] = (
        Field(default={})
    )

    @model_validator(mode="after")
    def _names_known(self) -> "Uncertainty":
        sections = {"inertia": Inertia.model_fields, "coefficients": Coefficients.model_fields}
        Problems.check(
            unknown_key((section, name), known)
            for section, known in sections.items()
            if isinstance(factors := getattr(self, section), dict)
            for name in factors
            if name not in known
        )
        return self


def true_aircraft(nominal: Aircraft, uncertainty: Uncertainty) -> Aircraft:
    """Return the aircraft that flies when the controller knows the nominal one.

    Factors are errors of a model, which are drawn one by one: their inertia need not be one that a
    rigid body can have, as long as the equations of motion have a solution.

    Raises:
        Problems: There is no such aircraft: its inertia is not positive definite, say.
    """
    true = nominal.model_dump()
    true["mass_kg"] *= uncertainty.mass
    _scale(true["inertia_kg_m2"], uncertainty.inertia)
    _scale(true["coefficients"], uncertainty.coefficients)
    inertia = Inertia.model_construct(**true["inertia_kg_m2"])
    true["any_inertia"] |= not inertia.of_rigid_body
    try:
        return Aircraft.model_validate(true)
    except ValidationError as exc:
        text = "makes a true aircraft that cannot be"
        lines = problems_of(Aircraft, exc)
        raise Problems([((), f"{text}: {line}") for line in lines]) from exc


def _scale(values: dict[str, float], by: float | dict[str, float]) -> None:
    factors = by if isinstance(by, dict) else dict.fromkeys(values, by)
    for name, factor in factors.items():
        values[name] *= factor
