"""``gcs fault set|clear|list``: actuator faults while the fleet is up."""

import inspect
import math
from collections.abc import Iterator
from typing import Annotated

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
from mavlink_defs.faults import Fault

app = typer.Typer(help="Set, clear and list actuator faults.", no_args_is_help=True)

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


def _options() -> Iterator[inspect.Parameter]:
    """Yield an option for each field of `FaultSpec` but the actuator."""
    for name, field in FaultSpec.model_fields.items():
        if (number := describe(field)) is None:
            continue
        limits = number.range() if number.le is not None else f"[{number.unit}]"
        metavar = (number.unit or "share").upper()
        option = typer.Option(metavar=metavar, help=f"{number.doc.rstrip('.')} {limits}.")
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
    actuator: Annotated[Actuator, typer.Argument(metavar="ACTUATOR", help=_NAMES)],
    options: dict[str, float | None],
    for_s: Annotated[
        float | None,
        typer.Option(metavar="S", help="Duration in simulated time [s], instead of --end-s."),
    ] = None,
) -> None:
    """Set an actuator fault: applied = effectiveness · commanded + bias, or another value.

    A fault replaces older ones of the same actuator that overlap it in time.
    """
    start_s = options["start_s"]
    if for_s is not None:
        if options["end_s"] is not None:
            raise BadInput("--end-s and --for-s both set the end", "leave one of them out")
        if not 0.0 < for_s < math.inf:
            raise BadInput(f"--for-s: expected more than 0 s, got {for_s:g}")
        options["end_s"] = None if start_s is None else start_s + for_s
    fault = _fault(actuator, options)

    async def action(vehicle: Vehicle) -> str:
        timed = fault
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
) -> None:
    """Clear faults: active, past and future ones."""

    async def action(vehicle: Vehicle) -> str:
        await vehicle.clear_faults(None if actuator is None else ACTUATORS.index(actuator))
        return f"UAV {vehicle.system}: faults of {actuator or 'all actuators'} cleared"

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


def _fault(actuator: Actuator, options: dict[str, float | None]) -> Fault:
    """Return the fault that options describe.

    Raises:
        BadInput: They do not go together; every problem is named.
    """
    try:
        return FaultSpec.model_validate({"actuator": actuator, **options}).command()
    except ValidationError as error:
        names = {key: f"--{key.replace('_', '-')}" for key in options}
        lines = [problem.line(names) for problem in problems_of(FaultSpec, error)]
        raise BadInput("\n".join(lines)) from None


async def _time_s(vehicle: Vehicle) -> float:
    """Request and return its simulated time [s]."""
    await vehicle.request(dialect.MAVLINK_MSG_ID_FTC_EVENTS)
    if (time_s := vehicle.state.time_s) is None:
        raise NoAnswer(f"UAV {vehicle.system} did not report its simulated time")
    return time_s


def _with_phase(fault: Fault, time_s: float) -> str:
    phase = "waiting" if time_s <= fault.start_s else "active" if time_s <= fault.end_s else "over"
    return f"{fault.describe()}, {phase}"
