"""The table of a flight in the form of our recordings: even steps, all channels in each."""

import json
from typing import TYPE_CHECKING

import numpy as np

from gcs.results.logs import names
from gcs.results.logs.table import FlightTable, LogChannel, channel
from mavlink_defs.origin import EARTH_RADIUS_M, Origin

if TYPE_CHECKING:
    import pyarrow as pa

_UAV = 1
"""The system id of a log's only vehicle."""


def recording_of(flight: FlightTable) -> "pa.Table":
    """Return a log as the table of a trajectory, at the rate of its fastest channel.

    It has the columns of `trajectory.arrows` that the log has, and its other channels; NaN where
    a channel has nothing. North, east and down are of the place where it has no others.
    """
    import pyarrow as pa

    origin = origin_of(flight)
    channels = {**flight.channels, **positions_of(flight, origin)}
    time_s = flight.grid()
    step_us = round(1e6 * (time_s[-1] - time_s[0]) / max(len(time_s) - 1, 1))
    columns = [pa.array(time_s), pa.array(np.full(len(time_s), _UAV, np.int16))]
    columns += [pa.array(one.at(time_s)) for one in channels.values()]
    fields = [
        pa.field("time_s", pa.float64(), False, {"unit": "s"}),
        pa.field("uav", pa.int16(), False),
        *(pa.field(one.name, pa.float64(), False, {"unit": one.unit}) for one in channels.values()),
    ]
    about = {
        "scenario": flight.title,
        "names": json.dumps({_UAV: flight.title}),
        "step_us": str(step_us),
        "every": "1",
    }
    if origin is not None:
        about["origin"] = origin.model_dump_json()
    return pa.table(columns, pa.schema(fields, about))


def origin_of(flight: FlightTable) -> Origin | None:
    """Return the first place of a flight; None if it never says where it is."""
    for place in (names.PLACE, names.GNSS_PLACE):
        if flight.has(place):
            latitude, longitude, altitude = (_first_known(flight[name]) for name in place)
            return Origin.model_construct(
                latitude_deg=latitude, longitude_deg=longitude, altitude_m=altitude
            )
    return None


def _first_known(one: LogChannel) -> float:
    """Return the first value that is none of a receiver without a fix, which says 0."""
    known = np.flatnonzero(one.values)
    return float(one.values[known[0]]) if len(known) else 0.0


def positions_of(flight: FlightTable, origin: Origin | None) -> dict[str, LogChannel]:
    """Return north, east and down of a flight [m], its own or of its places; empty without.

    Args:
        flight: The flight.
        origin: Where they count from, as of `origin_of`.
    """
    if flight.has(names.POSITION):
        return {name: flight[name] for name in names.POSITION}
    if origin is None:
        return {}
    place = names.PLACE if flight.has(names.PLACE) else names.GNSS_PLACE
    latitude, longitude, altitude = (flight[name] for name in place)
    parallel_m = EARTH_RADIUS_M * np.cos(np.radians(origin.latitude_deg))
    found = (
        (latitude, np.radians(latitude.values - origin.latitude_deg) * EARTH_RADIUS_M),
        (longitude, np.radians(longitude.values - origin.longitude_deg) * parallel_m),
        (altitude, origin.altitude_m - altitude.values),
    )
    made = [
        channel(name, of.time_s, values, of.source, of.clock)
        for name, (of, values) in zip(names.POSITION, found, strict=True)
    ]
    return {one.name: one for one in made if one is not None}
