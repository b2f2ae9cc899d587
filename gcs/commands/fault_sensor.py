"""``gcs fault sensor set|clear``: faults of sensors while the fleet is up."""

from typing import Annotated

import typer

from gcs.commands.fault_command import ForOption, number_options, set_fault
from gcs.commands.options import with_options
from gcs.commands.station import EXIT_STATUS, StationOptions, station_command
from gcs.console.errors import BadInput
from gcs.station.vehicle import Vehicle
from mavlink_defs.faults.sensors import (
    FAILURES,
    MAX_INSTANCES,
    SENSOR_NAMES,
    Axis,
    Failure,
    SensorName,
)
from mavlink_defs.faults.spec import SensorFaultSpec

app = typer.Typer(help="Set and clear faults of sensors.", no_args_is_help=True)

SENSORS = ", ".join(SENSOR_NAMES[:-1]) + f" or {SENSOR_NAMES[-1]}"
SensorArgument = Annotated[SensorName, typer.Argument(metavar="SENSOR", help=SENSORS)]
FailureOption = Annotated[
    Failure | None,
    typer.Option(metavar="TYPE", help=f"How it fails: {', '.join(FAILURES)}."),
]
InstanceOption = Annotated[
    int,
    typer.Option(
        min=0,
        max=MAX_INSTANCES,
        metavar="N",
        help="Number of the sensor, from 1; 0: all of them.",
    ),
]
AxisOption = Annotated[
    Axis | None,
    typer.Option(metavar="AXIS", help="Axis that is wrong: x, y or z; of a GPS north, east, down."),
]

_SET_EPILOG = f"""
Examples:

- gcs fault sensor set airspeed --failure stuck --uav 3
- gcs fault sensor set gyro --instance 1 --bias-deg-s 3 --for-s 20
- gcs fault sensor set airspeed --fade-s 60
{EXIT_STATUS}"""

_CLEAR_EPILOG = f"""
Examples:

- gcs fault sensor clear gyro --instance 1
- gcs fault sensor clear airspeed --uav 3
{EXIT_STATUS}"""


@app.command(name="set", epilog=_SET_EPILOG)
@station_command
@with_options("options", number_options(SensorFaultSpec), dict)
def set_(
    station: StationOptions,
    sensor: SensorArgument,
    failure: FailureOption = None,
    instance: InstanceOption = 0,
    axis: AxisOption = None,
    *,
    options: dict[str, float | None],
    for_s: ForOption = None,
) -> None:
    """Set a fault of a sensor.

    It fails in one of the ways of MAV_CMD_INJECT_FAILURE; a value says how much, else its default
    applies. A fault replaces older ones of the same sensor that overlap it in time.
    """
    named = {"failure": failure, "instance": instance or None, "axis": axis}
    set_fault(station, SensorFaultSpec, {"sensor": sensor}, options | named, for_s)


@app.command(epilog=_CLEAR_EPILOG)
@station_command
def clear(station: StationOptions, sensor: SensorArgument, instance: InstanceOption = 0) -> None:
    """Clear faults of a sensor: active, past and future ones."""
    clear_sensor(station, sensor, instance)


def clear_sensor(station: StationOptions, sensor: SensorName | None, instance: int) -> None:
    """Clear faults of a sensor; `instance` 0: of all of its kind.

    Raises:
        BadInput: An instance is given of no sensor.
    """
    if sensor is None:
        raise BadInput("--instance: expected a --sensor with it, got none")

    async def action(vehicle: Vehicle) -> str:
        await vehicle.clear_sensor_faults(sensor, instance)
        whose = f"{sensor} {instance or ''}".rstrip()
        return f"UAV {vehicle.system}: faults of {whose} cleared"

    station.act(action)
