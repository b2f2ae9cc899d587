"""Which surface an output moves, and by how much of its travel: by the autopilot's parameters.

As in ArduPilot 4.6 (SRV_Channel.cpp, ArduPlane/servos.cpp) and PX4 1.14 to 1.16 (control
allocation). Elevons and V-tails, each of which does two things, are taken apart.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from gcs.results.logs.column_map import ColumnMap
from gcs.results.logs.names import SHARES
from gcs.results.logs.table import FlightTable, LogChannel, by_name, channel

_AILERON, _ELEVATOR, _RUDDER, _THROTTLE = SHARES
_FUNCTIONS: Mapping[int, Mapping[str, float]] = {
    4: {_AILERON: 1.0},
    19: {_ELEVATOR: 1.0},
    21: {_RUDDER: 1.0},
    70: {_THROTTLE: 1.0},
    77: {_AILERON: -1.0, _ELEVATOR: 1.0},  # elevons, left and right
    78: {_AILERON: 1.0, _ELEVATOR: 1.0},
    79: {_RUDDER: 1.0, _ELEVATOR: 1.0},  # V-tail, left and right
    80: {_RUDDER: -1.0, _ELEVATOR: 1.0},
}
"""SERVOn_FUNCTION; of halves times twice MIXING_GAIN."""
_OTHER_HALF = {77: 78, 78: 77, 79: 80, 80: 79}
_SERVO, _MOTOR, _MOST = 201, 101, 8  # PWM_MAIN_FUNCn of the first of each; how many there may be
_TORQUES = {_AILERON: "R", _ELEVATOR: "P", _RUDDER: "Y"}


class _Output(NamedTuple):
    """An output: its values that are those shares, how much it makes of which, and who says so."""

    of: LogChannel
    values: tuple[float, ...]
    shares: tuple[float, ...]
    makes: Mapping[str, float]
    why: str

    def part_of(self, name: str, time_s: np.ndarray) -> np.ndarray:
        """Return what it makes of a share, at times of shape (n,)."""
        return np.asarray(
            self.makes[name] * np.interp(self.of.at(time_s), self.values, self.shares)
        )


def with_shares(flight: FlightTable) -> FlightTable:
    """Return a log with the shares of actuators that its outputs show, and what they do not."""
    had = {name.replace("held_", "share_") for name in flight.channels}
    missing = [one for one in SHARES if one not in had]
    outputs = [one for one in flight.channels if one.startswith(("output_", "servo_"))]
    if not missing or not outputs:
        return flight
    known, made, remarks = [*_of_ardupilot(flight), *_of_px4(flight)], [], []
    for name in missing:
        own = [one for one in known if one.makes.get(name)]
        if own:
            time_s = own[0].of.time_s
            values = np.sum([one.part_of(name, time_s) for one in own], axis=0)
            sources = " and ".join(f"{one.of.name} ({one.why})" for one in own)
            made.append(channel(name, time_s, values, sources, own[0].of.clock))
            remarks.append(f"{name} is of {sources}")
    if still := set(missing) - {name for one in known for name in one.makes}:
        used = {one.of.name for one in known} | {one.source for one in flight.channels.values()}
        unknown = [one for one in outputs if one not in used]
        remarks.append(
            f"no parameter of the log says which output moves what of {', '.join(sorted(still))} "
            f"(left: {', '.join(unknown) or 'none'}): a column map can (--columns)"
        )
    channels = by_name([*flight.channels.values(), *made])
    return replace(flight, channels=channels, remarks=(*flight.remarks, *remarks))


def with_columns(flight: FlightTable, own: ColumnMap) -> FlightTable:
    """Return a log with what a column map makes of its channels.

    Raises:
        BadInput: It has not one of them.
    """
    made = [
        one.channel(name, flight[one.column].time_s, flight[one.column].values, "log")
        for name, one in own.channels.items()
        if one.column in flight or not one.optional
    ]
    return replace(flight, channels=by_name([*made, *flight.channels.values()]))


def _of_ardupilot(flight: FlightTable) -> Iterator[_Output]:
    """Yield what SERVOn_... say; nothing of halves whose other half has no output."""
    said = flight.parameters
    functions = [int(said.get(f"SERVO{k}_FUNCTION", 0)) for k in range(1, 33)]
    for k, function in enumerate(functions, start=1):
        half = _OTHER_HALF.get(function)
        if function not in _FUNCTIONS or f"output_{k}" not in flight:
            continue
        if half is not None and half not in functions:
            continue
        whole = functions.count(function) * (2.0 * said.get("MIXING_GAIN", 0.5) if half else 1.0)
        low, high = said.get(f"SERVO{k}_MIN", 1100.0), said.get(f"SERVO{k}_MAX", 1900.0)
        values: tuple[float, ...] = (low, said.get(f"SERVO{k}_TRIM", 1500.0), high)
        shares: tuple[float, ...] = (-1.0, 0.0, 1.0)
        if function == 70:
            values, shares = (low, high), (0.0, 1.0)
        if said.get(f"SERVO{k}_REVERSED"):
            shares = shares[::-1]
        makes = {name: one / whole for name, one in _FUNCTIONS[function].items()}
        yield _Output(flight[f"output_{k}"], values, shares, makes, f"SERVO{k}_FUNCTION {function}")


def _of_px4(flight: FlightTable) -> Iterator[_Output]:
    """Yield what control allocation says of servos and motors, logged as shares or as pulses."""
    said = flight.parameters
    motors = int(said.get("CA_ROTOR_COUNT", 1))
    for k in range(_MOST):
        torques = {name: said.get(f"CA_SV_CS{k}_TRQ_{one}", 0.0) for name, one in _TORQUES.items()}
        makes = {name: one for name, one in torques.items() if one}
        trim = said.get(f"CA_SV_CS{k}_TRIM", 0.0)
        yield from _px4_output(
            flight, f"servo_{k + 1}", _SERVO + k, (-1.0 - trim, 1.0 - trim), makes
        )
        makes = {_THROTTLE: 1.0 / motors} if k < motors else {}
        yield from _px4_output(flight, f"motor_{k + 1}", _MOTOR + k, (0.0, 1.0), makes)


def _px4_output(
    flight: FlightTable,
    name: str,
    function: int,
    shares: tuple[float, float],
    makes: Mapping[str, float],
) -> Iterator[_Output]:
    if makes and name in flight:
        yield _Output(flight[name], (-1.0 if shares[0] else 0.0, 1.0), shares, makes, "CA_...")
        return
    said = flight.parameters
    for k in range(1, 17):
        if makes and said.get(f"PWM_MAIN_FUNC{k}") == function and f"output_{k}" in flight:
            ends = said.get(f"PWM_MAIN_MIN{k}", 1000.0), said.get(f"PWM_MAIN_MAX{k}", 2000.0)
            is_reversed = int(said.get("PWM_MAIN_REV", 0)) >> (k - 1) & 1
            made = shares[::-1] if is_reversed else shares
            yield _Output(flight[f"output_{k}"], ends, made, makes, f"PWM_MAIN_FUNC{k} {function}")
