"""What a log cannot say, by what it lacks."""

from collections.abc import Iterator

from gcs.results.logs import names
from gcs.results.logs.table import FlightTable

_SLOW_HZ = 5.0
"""Below this the short period of a small aircraft, about 1 s, has fewer than five samples."""
_MANY_REPEATS = 0.5


def shortcomings(flight: FlightTable) -> Iterator[str]:
    """Yield what a flight does not show and why, a line each."""
    if flight.duration_s < 2.0:
        yield f"it lasts {flight.duration_s:.3g} s: too short to say anything of the aircraft"
    missing = [
        (names.ATTITUDE, "no attitude", "where forces and winds point to is unknown"),
        (names.RATES, "no rates", "moments, and with them faults of surfaces, do not show"),
        (names.FORCE, "no accelerations", "forces can only be had from the change of velocity"),
    ]
    for group, what, so in missing:
        if not flight.has(group):
            yield f"{what} ({', '.join(one for one in group if one not in flight)}): {so}"
    if flight.airspeed is None:
        yield "no airspeed: coefficients need an assumed wind"
    commands = ("held_", "share_", "output_", "servo_")
    if not any(name.startswith(commands) for name in flight.channels):
        yield "no commands to actuators: a fault shows only in how the aircraft moves"
    for group in (names.RATES, names.ATTITUDE):
        if not flight.has(group):
            continue
        rate = min(flight[name].rate_hz for name in group)
        renewed = max(flight[name].renewed_hz for name in group)
        which = ", ".join(group)
        if rate and rate < _SLOW_HZ:
            yield f"{which} at {rate:.2g} Hz: motions faster than {2.0 / rate:.2g} s are not in it"
        elif not renewed:
            yield f"{which} never change: the log has them, and no flight"
        elif renewed < _MANY_REPEATS * rate:
            yield f"{which} are in {rate:.3g} rows a second, and new {renewed:.2g} times a second"
