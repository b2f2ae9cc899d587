"""The aircraft as the compiled code sees it: Table I of the paper as one flat record."""

from typing import TypeAlias

import numpy as np

from mavlink_defs.constants import SURFACES
from sitl_plant.airframe.config import Aircraft, Coefficients
from sitl_plant.airframe.propulsion import MAX_ROWS, Propulsion

COEFFICIENTS = tuple(Coefficients.model_fields)
"""Aerodynamic coefficients and derivatives, per rad."""

_SUFFIXES = ("_da", "_de", "_dr")  # of what a surface makes, in the order of SURFACES

AIRCRAFT = np.dtype(
    [
        ("m", "f8"),  # kg
        ("S", "f8"),  # m²
        ("b", "f8"),  # m
        ("c_bar", "f8"),  # m
        ("rho", "f8"),  # kg/m³
        ("g", "f8"),  # m/s²
        ("J", "f8", (3, 3)),  # kg m², eq. (5)
        ("J_inv", "f8", (3, 3)),
        *((name, "f8") for name in COEFFICIENTS),
        ("per_rad_s", "i8"),  # 1: rate derivatives are per rad/s, as Table I's unit says
        ("stall", "f8"),  # angle of attack [rad], 0: none
        ("stall_sharpness", "f8"),  # 1/rad
        ("thrust_limit", "f8"),  # N
        ("stops", "f8", (3, 2)),  # least and largest aileron, elevator, rudder [rad]
        ("thrust_rows", "i8"),  # of the table of the largest thrust; 0: it is thrust_limit
        ("thrust_airspeeds", "f8", (MAX_ROWS,)),  # m/s, rising
        ("thrust_most", "f8", (MAX_ROWS,)),  # N
        ("thrust_arms", "f8", (3,)),  # rolling, pitching, yawing moment by thrust [m]
        ("thrust_lag", "f8"),  # s
    ]
)

AircraftRecord: TypeAlias = np.void
"""Record of dtype `AIRCRAFT`: the true aircraft of a plant, the nominal one of a controller."""


def aircraft_record(aircraft: Aircraft) -> AircraftRecord:
    """Turn an aircraft's configuration into the record that the equations read.

    Args:
        aircraft: The true aircraft for a plant, the nominal one for a controller.

    Returns:
        A record of dtype `AIRCRAFT`, SI units and radians.
    """
    record = np.zeros(1, AIRCRAFT)
    inertia = aircraft.inertia_kg_m2
    J = np.array(
        [
            [inertia.Jxx, 0.0, -inertia.Jxz],
            [0.0, inertia.Jyy, 0.0],
            [-inertia.Jxz, 0.0, inertia.Jzz],
        ]
    )
    record["m"] = aircraft.mass_kg
    record["S"] = aircraft.wing_area_m2
    record["b"] = aircraft.wing_span_m
    record["c_bar"] = aircraft.mean_chord_m
    record["rho"] = aircraft.air_density_kg_m3
    record["g"] = aircraft.gravity_m_s2
    record["J"] = J
    record["J_inv"] = np.linalg.inv(J)
    for name in COEFFICIENTS:
        record[name] = getattr(aircraft.coefficients, name)
    for surface, suffix in zip(SURFACES, _SUFFIXES, strict=True):
        if not aircraft.has(surface):
            for name in COEFFICIENTS:
                if name.rstrip("2").endswith(suffix):
                    record[name] = 0.0
    record["per_rad_s"] = aircraft.rate_derivatives == "per_rad_s"
    if aircraft.stall_deg is not None:
        record["stall"] = np.radians(aircraft.stall_deg)
        record["stall_sharpness"] = aircraft.stall_sharpness
    record["thrust_limit"] = aircraft.thrust_limit_n
    record["stops"] = np.radians(aircraft.stops_deg)
    if aircraft.propulsion is not None:
        _write_propulsion(record[0], aircraft, aircraft.propulsion)
    return record[0]  # type: ignore[no-any-return]  # numpy gives Any


def _write_propulsion(record: AircraftRecord, aircraft: Aircraft, propulsion: Propulsion) -> None:
    rows = propulsion.table(aircraft.air_density_kg_m3)
    record["thrust_rows"] = len(rows)
    record["thrust_airspeeds"][: len(rows)] = [row.airspeed_m_s for row in rows]
    record["thrust_most"][: len(rows)] = [row.thrust_n for row in rows]
    record["thrust_arms"] = propulsion.arms_m(aircraft.air_density_kg_m3, aircraft.design_airspeed)
    record["thrust_lag"] = propulsion.lag_s
