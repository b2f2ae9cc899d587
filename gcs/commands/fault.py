"""``gcs fault set|clear|list|sensor``: faults of actuators and sensors while the fleet is up."""

import inspect
import math
from collections.abc import Iterator, Mapping
from typing import Annotated, Any

import typer
from pydantic import ValidationError

from gcs.commands.options import with_options
from gcs.commands.station import StationOptions, station_command
from gcs.console.errors import BadInput, NoAnswer
from gcs.station.vehicle import Vehicle
from mavlink_defs import dialect
from mavlink_defs.config.files import problems_of
from mavlink_defs.config.quantity import describe
from mavlink_defs.constants import Actuator
from mavlink_defs.faults import sensors
from mavlink_defs.faults.fault import Fault
from mavlink_defs.faults.spec import SPECS, ActuatorFaultSpec, FaultSpec, SensorFaultSpec

app = typer.Typer(help="Set, clear and list faults of actuators and sensors.", no_args_is_help=True)
of_sensors = typer.Typer(help="Set and clear faults of sensors.", no_args_is_help=True)
app.add_typer(of_sensors, name="sensor")

_ACTUATORS = "aileron, elevator, rudder or throttle"
_SENSORS = ", ".join(sensors.SENSOR_NAMES[:-1]) + f" or {sensors.SENSOR_NAMES[-1]}"
_ZERO_IS_NONE = {"frequency_hz", "instance"}

_ForOption = Annotated[
    float | None,
    typer.Option(metavar="S", help="Duration in simulated time [s], instead of --end-s."),
]
_SensorArgument = Annotated[sensors.SensorName, typer.Argument(metavar="SENSOR", help=_SENSORS)]
_InstanceOption = Annotated[
    int,
    typer.Option(
        min=0,
        max=sensors.MAX_INSTANCES,
        metavar="N",
        help="Number of the sensor, from 1; 0: all of them.",
    ),
]


def _numbers(model: type[FaultSpec]) -> Iterator[inspect.Parameter]:
    """Yield an option for each number of a fault."""
    for name, field in model.model_fields.items():
        number = describe(field)
        if number is None or name == "instance":
            continue
        limits = number.range() if number.le is not None else f"[{number.unit}]"
        metavar = (number.unit or ("share" if model is ActuatorFaultSpec else "factor")).upper()
        doc = f"{number.doc.rstrip('.')} {limits}."
        option = typer.Option(metavar=metavar, help=doc)
        yield _parameter(name, Annotated[float | None, option], field.default)


def _of_a_sensor() -> Iterator[inspect.Parameter]:
    """Yield the options of a fault of a sensor."""
    failure = typer.Option(metavar="TYPE", help=f"How it fails: {', '.join(sensors.FAILURES)}.")
    axis = typer.Option(
        metavar="AXIS", help="Axis that is wrong: x, y or z; of a GPS north, east, down."
    )
    yield _parameter("failure", Annotated[sensors.Failure | None, failure])
    yield _parameter("instance", _InstanceOption, 0)
    yield _parameter("axis", Annotated[sensors.Axis | None, axis])
    yield from _numbers(SensorFaultSpec)


def _parameter(name: str, annotation: Any, default: Any = None) -> inspect.Parameter:
    keyword = inspect.Parameter.KEYWORD_ONLY
    return inspect.Parameter(name, keyword, default=default, annotation=annotation)


@app.command(name="set")
@station_command
@with_options("options", _numbers(ActuatorFaultSpec), dict)
def set_(
    station: StationOptions,
    actuator: Annotated[Actuator, typer.Argument(metavar="ACTUATOR", help=_ACTUATORS)],
    *,
    options: dict[str, Any],
    for_s: _ForOption = None,
) -> None:
    """Set a fault of an actuator, applied = effectiveness · commanded + bias.

    A fault replaces older ones of the same actuator that overlap it in time. Of sensors:
    `gcs fault sensor set`.

    Examples:
        - gcs fault set rudder --uav 3 --effectiveness 0.5 --bias-deg 1
        - gcs fault set elevator --stuck-deg 5 --for-s 3
        - gcs fault set aileron --effectiveness 0.2 --intermittent-deg 0 --frequency-hz 0.5
        - gcs fault set throttle --bias-n -2 --start-s 19 --end-s 22 --json
    """
    _set(station, "actuator", actuator, options, for_s)


@of_sensors.command(name="set")
@station_command
@with_options("options", _of_a_sensor(), dict)
def set_of_sensor(
    station: StationOptions,
    sensor: _SensorArgument,
    *,
    options: dict[str, Any],
    for_s: _ForOption = None,
) -> None:
    """Set a fault of a sensor.

    It fails in one of the ways of MAV_CMD_INJECT_FAILURE; a value says how much, else its default
    applies. A fault replaces older ones of the same sensor that overlap it in time.

    Examples:
        - gcs fault sensor set airspeed --failure stuck --uav 3
        - gcs fault sensor set gyro --instance 1 --bias-deg-s 3 --for-s 20
        - gcs fault sensor set airspeed --fade-s 60
    """
    _set(station, "sensor", sensor, options, for_s)


@app.command()
@station_command
def clear(
    station: StationOptions,
    actuator: Annotated[
        Actuator | None,
        typer.Option(metavar="ACTUATOR", help=f"Clear faults of this actuator only: {_ACTUATORS}."),
    ] = None,
) -> None:
    """Clear faults: active, past and future ones, of actuators and sensors.

    For one sensor: `gcs fault sensor clear`.

    Examples:
        - gcs fault clear
        - gcs fault clear --actuator rudder --uav 3
    """

    async def action(vehicle: Vehicle) -> str:
        await vehicle.clear_faults(actuator)
        return f"UAV {vehicle.system}: faults of {actuator or 'all actuators and sensors'} cleared"

    station.act(action)


@of_sensors.command(name="clear")
@station_command
def clear_of_sensor(
    station: StationOptions, sensor: _SensorArgument, instance: _InstanceOption = 0
) -> None:
    """Clear faults of a sensor: active, past and future ones.

    Examples:
        - gcs fault sensor clear gyro --instance 1
        - gcs fault sensor clear airspeed --uav 3
    """

    async def action(vehicle: Vehicle) -> str:
        await vehicle.clear_sensor_faults(sensor, instance)
        whose = f"{sensor} {instance or ''}".rstrip()
        return f"UAV {vehicle.system}: faults of {whose} cleared"

    station.act(action)


@app.command(name="list")
@station_command
def list_(station: StationOptions) -> None:
    """List the faults of vehicles, including past and future ones.

    Examples:
        - gcs fault list
        - gcs fault list --uav 3 --json | jq '.[].faults[] | select(.active)'
    """

    async def action(vehicle: Vehicle) -> str:
        faults = await vehicle.faults()
        now_s = await _time_s(vehicle)
        lines = [f"UAV {vehicle.system}: {_with_phase(fault, now_s)}" for fault in faults]
        return "\n".join(lines) or f"UAV {vehicle.system}: no faults"

    def data(vehicle: Vehicle) -> dict[str, object]:
        now_s = vehicle.state.time_s
        faults = [fault.as_dict(now_s) for fault in vehicle.state.faults or ()]
        return {"time_s": now_s, "faults": faults}

    station.act(action, data)


def _with_phase(fault: Fault, now_s: float) -> str:
    phase = "waiting" if now_s <= fault.start_s else "active" if now_s <= fault.end_s else "over"
    return f"{fault.describe()}, {phase}"


def _set(
    station: StationOptions, key: str, name: str, options: Mapping[str, Any], for_s: float | None
) -> None:
    """Set the fault that options describe, at every chosen vehicle.

    Args:
        station: Reaches the vehicles.
        key: Of its family.
        name: Of its target.
        options: The others; None: not given.
        for_s: Duration [s] instead of an end.

    Raises:
        BadInput: They do not go together; every problem is named.
    """
    start_s, given = options["start_s"], {**options, key: name}
    if for_s is not None:
        if options["end_s"] is not None:
            raise BadInput("--end-s and --for-s both set the end", "leave one of them out")
        if not 0.0 < for_s < math.inf:
            raise BadInput(f"--for-s: expected more than 0 s, got {for_s:g}")
        given["end_s"] = None if start_s is None else start_s + for_s
    fault = _fault(SPECS[key], given)

    async def action(vehicle: Vehicle) -> str:
        timed = fault
        if start_s is None and for_s is not None:
            timed = fault._replace(end_s=await _time_s(vehicle) + for_s)
        await vehicle.set_fault(timed)
        return f"UAV {vehicle.system}: {timed.describe()}"

    station.act(action)


def _fault(model: type[FaultSpec], options: Mapping[str, Any]) -> Fault:
    names = {key: f"--{key.replace('_', '-')}" for key in options if key != model.FAMILY.key}
    given = {
        key: value
        for key, value in options.items()
        if value is not None and (value or key not in _ZERO_IS_NONE)
    }
    try:
        return model.model_validate(given).command()
    except ValidationError as error:
        lines = [problem.line(names) for problem in problems_of(model, error)]
        raise BadInput("\n".join(lines)) from None


async def _time_s(vehicle: Vehicle) -> float:
    """Request and return its simulated time [s]."""
    await vehicle.request(dialect.MAVLINK_MSG_ID_FTC_EVENTS)
    if (now_s := vehicle.state.time_s) is None:
        raise NoAnswer(f"UAV {vehicle.system} did not report its simulated time")
    return now_s
