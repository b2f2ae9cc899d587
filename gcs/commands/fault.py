"""``gcs fault set|clear|list|sensor``: faults of actuators and sensors while the fleet is up."""

from typing import Annotated

import typer

from gcs.commands import fault_sensor
from gcs.commands.fault_command import ForOption, number_options, set_fault, time_s
from gcs.commands.options import with_options
from gcs.commands.station import EXIT_STATUS, StationOptions, station_command
from gcs.console.errors import BadInput
from gcs.station.vehicle import Vehicle
from mavlink_defs.constants import Actuator
from mavlink_defs.faults.fault import Fault
from mavlink_defs.faults.sensors import Axis, Failure, SensorName
from mavlink_defs.faults.spec import SPECS, ActuatorFaultSpec, SensorFaultSpec

app = typer.Typer(help="Set, clear and list faults of actuators and sensors.", no_args_is_help=True)
app.add_typer(fault_sensor.app, name="sensor")

_NAMES = "aileron, elevator, rudder or throttle"

_SET_EPILOG = f"""
Examples:

- gcs fault set rudder --uav 3 --effectiveness 0.5 --bias-deg 1
- gcs fault set elevator --stuck-deg 5 --for-s 3
- gcs fault set aileron --effectiveness 0.2 --intermittent-deg 0 --frequency-hz 0.5
- gcs fault set throttle --bias-n -2 --start-s 19 --end-s 22 --json
{EXIT_STATUS}"""

_CLEAR_EPILOG = f"""
Examples:

- gcs fault clear
- gcs fault clear --actuator rudder --uav 3
{EXIT_STATUS}"""

_LIST_EPILOG = f"""
Examples:

- gcs fault list
- gcs fault list --uav 3 --json | jq '.[].faults[] | select(.active)'
{EXIT_STATUS}"""

# the way in which `gcs fault sensor` was written before, for one version
_SensorOption = Annotated[SensorName | None, typer.Option(hidden=True)]
_InstanceOption = Annotated[int, typer.Option(min=0, hidden=True)]


@app.command(name="set", epilog=_SET_EPILOG)
@station_command
@with_options("options", number_options(ActuatorFaultSpec), dict)
@with_options("of_sensor", number_options(SensorFaultSpec, hidden=True), dict)
def set_(
    station: StationOptions,
    actuator: Annotated[Actuator | None, typer.Argument(metavar="ACTUATOR", help=_NAMES)] = None,
    *,
    options: dict[str, float | None],
    for_s: ForOption = None,
    sensor: _SensorOption = None,
    failure: Annotated[Failure | None, typer.Option(hidden=True)] = None,
    instance: _InstanceOption = 0,
    axis: Annotated[Axis | None, typer.Option(hidden=True)] = None,
    of_sensor: dict[str, float | None],
) -> None:
    """Set a fault of an actuator, applied = effectiveness · commanded + bias.

    A fault replaces older ones of the same actuator that overlap it in time. Of sensors:
    `gcs fault sensor set`.
    """
    if (actuator is None) == (sensor is None):
        got = "got none" if sensor is None else f"got {actuator} and the sensor {sensor}"
        raise BadInput(
            f"expected an actuator ({_NAMES}), {got}",
            f"of a sensor ({fault_sensor.SENSORS}): gcs fault sensor set SENSOR",
        )
    named = {"failure": failure, "instance": instance or None, "axis": axis}
    given = {key: value for key, value in (named | of_sensor).items() if value is not None}
    key, name = ("actuator", str(actuator)) if sensor is None else ("sensor", str(sensor))
    set_fault(station, SPECS[key], {key: name}, options | given, for_s)


@app.command(epilog=_CLEAR_EPILOG)
@station_command
def clear(
    station: StationOptions,
    actuator: Annotated[
        Actuator | None,
        typer.Option(metavar="ACTUATOR", help=f"Clear faults of this actuator only: {_NAMES}."),
    ] = None,
    sensor: _SensorOption = None,
    instance: _InstanceOption = 0,
) -> None:
    """Clear faults: active, past and future ones, of actuators and sensors.

    For one sensor: `gcs fault sensor clear`.
    """
    if actuator is not None and sensor is not None:
        raise BadInput("--actuator and --sensor both say whose", "leave one of them out")
    if sensor is not None or instance:
        fault_sensor.clear_sensor(station, sensor, instance)
        return

    async def action(vehicle: Vehicle) -> str:
        await vehicle.clear_faults(actuator)
        return f"UAV {vehicle.system}: faults of {actuator or 'all actuators and sensors'} cleared"

    station.act(action)


@app.command(name="list", epilog=_LIST_EPILOG)
@station_command
def list_(station: StationOptions) -> None:
    """List the faults of vehicles, including past and future ones."""

    async def action(vehicle: Vehicle) -> str:
        faults = await vehicle.faults()
        now_s = await time_s(vehicle)
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
