"""``gcs fault set|clear|list``: faults of actuators and sensors while the fleet is up."""

import inspect
import math
from collections.abc import Iterator, Mapping
from typing import Annotated, Any

import typer
from pydantic import ValidationError

from gcs.commands.options import with_options
from gcs.commands.station import EXIT_STATUS, Station, station_command
from gcs.errors import BadInput, NoAnswer
from gcs.station.vehicle import Vehicle
from mavlink_defs import dialect
from mavlink_defs.config.files import problems_of
from mavlink_defs.config.quantity import describe
from mavlink_defs.constants import ACTUATORS, Actuator
from mavlink_defs.fault_spec import FaultSpec
from mavlink_defs.sensor_fault_kinds import FAILURES, SENSOR_NAMES, Axis, Failure, SensorName
from mavlink_defs.sensor_fault_spec import MOST_INSTANCES, SensorFaultSpec
from mavlink_defs.sensor_faults import AnyFault

app = typer.Typer(help="Set, clear and list faults of actuators and sensors.", no_args_is_help=True)

_NAMES = "aileron, elevator, rudder or throttle"
_SENSORS = ", ".join(SENSOR_NAMES[:-1]) + f" or {SENSOR_NAMES[-1]}"

_SENSOR_PANEL = "Sensors"
InstanceOption = Annotated[
    int,
    typer.Option(
        min=0,
        max=MOST_INSTANCES,
        metavar="N",
        help="Number of the sensor, from 1; 0: all of them.",
        rich_help_panel=_SENSOR_PANEL,
    ),
]

_SET_EPILOG = f"""
Examples:

- gcs fault set rudder --uav 3 --effectiveness 0.5 --bias-deg 1
- gcs fault set elevator --stuck-deg 5 --for-s 3
- gcs fault set aileron --effectiveness 0.2 --intermittent-deg 0 --frequency-hz 0.5
- gcs fault set throttle --bias-n -2 --start-s 19 --end-s 22 --json
- gcs fault set --sensor airspeed --failure stuck --uav 3
- gcs fault set --sensor gyro --instance 1 --bias-deg-s 3 --for-s 20
- gcs fault set --sensor airspeed --fade-s 60
{EXIT_STATUS}"""

_CLEAR_EPILOG = f"""
Examples:

- gcs fault clear
- gcs fault clear --actuator rudder --uav 3
- gcs fault clear --sensor gyro --instance 1
{EXIT_STATUS}"""

_LIST_EPILOG = f"""
Examples:

- gcs fault list
- gcs fault list --uav 3 --json | jq '.[].faults[] | select(.active)'
{EXIT_STATUS}"""


def _options() -> Iterator[inspect.Parameter]:
    """Yield an option for each number of a fault, of actuators first."""
    for name, field in (FaultSpec.model_fields | SensorFaultSpec.model_fields).items():
        if (number := describe(field)) is None or name == "instance":
            continue
        limits = number.range() if number.le is not None else f"[{number.unit}]"
        of_actuator = name in FaultSpec.model_fields
        metavar = (number.unit or ("share" if of_actuator else "factor")).upper()
        panel = None if of_actuator else _SENSOR_PANEL
        doc = f"{number.doc.rstrip('.')} {limits}."
        option = typer.Option(metavar=metavar, help=doc, rich_help_panel=panel)
        yield inspect.Parameter(
            name,
            inspect.Parameter.KEYWORD_ONLY,
            default=field.default,
            annotation=Annotated[float | None, option],
        )


@app.command(name="set", epilog=_SET_EPILOG)
@station_command
@with_options("options", _options(), dict)
def set_(
    station: Station,
    actuator: Annotated[
        Actuator | None, typer.Argument(metavar="ACTUATOR", help=f"{_NAMES}; or give --sensor")
    ] = None,
    sensor: Annotated[
        SensorName | None,
        typer.Option(
            metavar="SENSOR", help=f"Sensor that fails: {_SENSORS}.", rich_help_panel=_SENSOR_PANEL
        ),
    ] = None,
    failure: Annotated[
        Failure | None,
        typer.Option(
            metavar="TYPE",
            help=f"How it fails: {', '.join(FAILURES)}.",
            rich_help_panel=_SENSOR_PANEL,
        ),
    ] = None,
    instance: InstanceOption = 0,
    axis: Annotated[
        Axis | None,
        typer.Option(
            metavar="AXIS",
            help="Axis that is wrong: x, y or z; of a GPS north, east, down.",
            rich_help_panel=_SENSOR_PANEL,
        ),
    ] = None,
    *,
    options: dict[str, float | None],
    for_s: Annotated[
        float | None,
        typer.Option(metavar="S", help="Duration in simulated time [s], instead of --end-s."),
    ] = None,
) -> None:
    """Set a fault of an actuator, applied = effectiveness · commanded + bias, or of a sensor.

    A sensor fails in one of the ways of MAV_CMD_INJECT_FAILURE; a value says how much, else its
    default applies.
    A fault replaces older ones of the same actuator or sensor that overlap it in time.
    """
    start_s = options["start_s"]
    if for_s is not None:
        if options["end_s"] is not None:
            raise BadInput("--end-s and --for-s both set the end", "leave one of them out")
        if not 0.0 < for_s < math.inf:
            raise BadInput(f"--for-s: expected more than 0 s, got {for_s:g}")
        options["end_s"] = None if start_s is None else start_s + for_s
    named = {"failure": failure, "instance": instance or None, "axis": axis}
    fault = _fault(actuator, sensor, options | named)

    async def action(vehicle: Vehicle) -> str:
        timed: AnyFault = fault
        if start_s is None and for_s is not None:
            timed = fault._replace(end_s=await _time_s(vehicle) + for_s)
        await vehicle.set_fault(timed)
        return f"UAV {vehicle.system}: {timed.describe()}"

    station.act(action)


@app.command(epilog=_CLEAR_EPILOG)
@station_command
def clear(
    station: Station,
    actuator: Annotated[
        Actuator | None,
        typer.Option(metavar="ACTUATOR", help=f"Clear faults of this actuator only: {_NAMES}."),
    ] = None,
    sensor: Annotated[
        SensorName | None,
        typer.Option(metavar="SENSOR", help=f"Clear faults of this sensor only: {_SENSORS}."),
    ] = None,
    instance: InstanceOption = 0,
) -> None:
    """Clear faults: active, past and future ones, of actuators and sensors."""
    if actuator is not None and sensor is not None:
        raise BadInput("--actuator and --sensor both say whose", "leave one of them out")
    if sensor is None and instance:
        raise BadInput("--instance: expected a --sensor with it, got none")

    async def action(vehicle: Vehicle) -> str:
        if sensor is not None:
            await vehicle.clear_sensor_faults(sensor, instance)
            whose = f"{sensor} {instance or ''}".rstrip()
        else:
            await vehicle.clear_faults(None if actuator is None else ACTUATORS.index(actuator))
            whose = actuator or "all actuators and sensors"
        return f"UAV {vehicle.system}: faults of {whose} cleared"

    station.act(action)


@app.command(name="list", epilog=_LIST_EPILOG)
@station_command
def list_(station: Station) -> None:
    """List the faults of vehicles, including past and future ones."""

    async def action(vehicle: Vehicle) -> str:
        faults = await vehicle.list_faults()
        time_s = await _time_s(vehicle)
        lines = [f"UAV {vehicle.system}: {_with_phase(fault, time_s)}" for fault in faults]
        return "\n".join(lines) or f"UAV {vehicle.system}: no faults"

    def data(vehicle: Vehicle) -> dict[str, object]:
        time_s = vehicle.state.time_s
        faults = [fault.as_dict(time_s) for fault in vehicle.state.faults or ()]
        return {"time_s": time_s, "faults": faults}

    station.act(action, data)


def _fault(
    actuator: Actuator | None, sensor: SensorName | None, options: Mapping[str, Any]
) -> AnyFault:
    """Return the fault that options describe.

    Raises:
        BadInput: They do not go together; every problem is named.
    """
    if (actuator is None) == (sensor is None):
        got = "got neither" if sensor is None else f"got {actuator} and {sensor}"
        raise BadInput(f"expected an actuator ({_NAMES}) or --sensor ({_SENSORS}), {got}")
    model: type[FaultSpec | SensorFaultSpec] = FaultSpec if sensor is None else SensorFaultSpec
    part = {"actuator": actuator} if sensor is None else {"sensor": sensor}
    names = {key: f"--{key.replace('_', '-')}" for key in options}
    given = {
        key: value
        for key, value in options.items()
        if value is not None and (value != 0.0 or key != "frequency_hz")
    }
    unfit = [names[key] for key in given if key not in model.model_fields]
    if unfit:
        kind = "an actuator; is --sensor missing?" if sensor is None else "a sensor"
        raise BadInput("\n".join(f"{name}: does not fit {kind}" for name in unfit))
    try:
        return model.model_validate(part | given).command()
    except ValidationError as error:
        lines = [problem.line(names) for problem in problems_of(model, error)]
        raise BadInput("\n".join(lines)) from None


async def _time_s(vehicle: Vehicle) -> float:
    """Request and return its simulated time [s]."""
    await vehicle.request(dialect.MAVLINK_MSG_ID_FTC_EVENTS)
    if (time_s := vehicle.state.time_s) is None:
        raise NoAnswer(f"UAV {vehicle.system} did not report its simulated time")
    return time_s


def _with_phase(fault: AnyFault, time_s: float) -> str:
    phase = "waiting" if time_s <= fault.start_s else "active" if time_s <= fault.end_s else "over"
    return f"{fault.describe()}, {phase}"
