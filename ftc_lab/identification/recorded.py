"""Identification from a recorded flight, which excites what it excites."""

from pathlib import Path

import numpy as np

from ftc_lab.design.airframe import cruise_of
from ftc_lab.identification.fit import fit
from ftc_lab.identification.identified import Identified, finished, within_bounds
from ftc_lab.identification.readings import WINDOW_S, Readings, windows_of
from gcs.console.errors import BadInput
from gcs.results.recording import Recording
from gcs.results.store import read_recording
from mavlink_defs.constants import THROTTLE
from sitl_plant.airframe.aircraft import aircraft_record
from sitl_plant.airframe.config import Aircraft, Coefficients
from sitl_plant.simulators.base import Body

_GROUP_S = 1.0  # of time: errors of one group are not independent
_JUMP = np.radians(0.5)  # of a surface from one step to the next: a servo without a lag
_THRUST_JUMP = 0.005  # of the thrust limit; the same
_DIGITS = 6


def identify_recording(folder: Path, nominal: Aircraft, uav: int | None = None) -> Identified:
    """Identify an aircraft from a full recording of a run folder.

    Args:
        folder: Run folder.
        nominal: The aircraft as it is known: size, mass, limits, and every coefficient that the
            flight does not show.
        uav: System id; None: the first one.

    Raises:
        BadInput: There is no full recording of such a UAV, or it is too short.
    """
    recording = read_recording(folder)
    ids = recording.uav_ids
    if uav is not None and uav not in ids:
        known = ", ".join(map(str, ids))
        raise BadInput(f"--uav is {uav}, expected one of {known}, the UAVs of {folder}")
    readings = readings_of(recording, nominal, 0 if uav is None else ids.index(uav))
    if readings.dt > WINDOW_S / 2.0:
        text = f"{folder} has a step of {readings.dt:g} s, expected at most {WINDOW_S / 2.0:g} s"
        raise BadInput(text, "fly with a shorter step_us")
    windows = windows_of(readings, body_of(nominal))
    if len(np.unique(windows.group)) < 2:
        raise BadInput(f"{folder} is too short to identify anything, expected 2 s or more")
    values = nominal.coefficients.model_dump()
    found = fit(windows, values)
    changed = {
        name: within_bounds(name, float(f"{one.value:.{_DIGITS}g}"))
        for name, one in found.estimates.items()
    }
    coefficients = Coefficients.model_validate(values | changed)
    source = f"{nominal.source or 'nominal'}; coefficients from a flight"
    aircraft = nominal.model_copy(update={"coefficients": coefficients, "source": source})
    return finished(aircraft, found, cruise_of(nominal), None)


def body_of(aircraft: Aircraft) -> Body:
    """Return size, mass and inertia of an aircraft."""
    return Body(
        aircraft.mass_kg,
        aircraft.inertia_kg_m2,
        aircraft.wing_area_m2,
        aircraft.wing_span_m,
        aircraft.mean_chord_m,
        aircraft.air_density_kg_m3,
    )


def readings_of(recording: Recording, aircraft: Aircraft, i: int) -> Readings:
    """Return the readings of the i-th UAV of a flight.

    A surface or thrust that jumps ends a piece: within a step, it is not known when.
    """
    states, applied = recording.states[:, i], recording.applied[:, i]
    dt = recording.step_us / 1e6
    moved = np.abs(np.diff(applied, axis=0))
    jumps = (moved[:, :THROTTLE] > _JUMP).any(axis=1)
    jumps |= moved[:, THROTTLE] > _THRUST_JUMP * aircraft.thrust_limit_n
    roll, pitch = states[:, 6], states[:, 7]
    down = np.stack(
        [-np.sin(pitch), np.cos(pitch) * np.sin(roll), np.cos(pitch) * np.cos(roll)], axis=1
    )
    return Readings(
        dt=dt,
        v=states[:, 3:6] - recording.wind[:, i],
        omega=states[:, 9:12],
        force=None,
        delta=applied[:, :THROTTLE],
        thrust=applied[:, THROTTLE],
        piece=np.concatenate([[0], np.cumsum(jumps)]),
        group=(recording.time_s / _GROUP_S).astype(np.int64),
        ground=states[:, 3:6],
        gravity=aircraft.gravity_m_s2 * down,
        arms=np.array(aircraft_record(aircraft)["thrust_arms"]),
    )
