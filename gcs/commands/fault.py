"""``gcs fault set|clear|list``: actuator faults while the fleet is up."""

import math
from dataclasses import replace
from typing import Annotated, Any

import typer

from gcs.commands.station import EXIT_STATUS, Station, station_command
from gcs.errors import BadInput, NoAnswer
from gcs.station.fault_text import describe_fault
from gcs.station.status import fault_dict
from gcs.station.vehicle import Vehicle
from mavlink_defs import dialect
from mavlink_defs.constants import ACTUATORS, Actuator
from mavlink_defs.faults import Fault

app = typer.Typer(help="Set, clear and list actuator faults.", no_args_is_help=True)

_NAMES = "aileron, elevator, rudder or throttle"

_SET_EPILOG = f"""
Examples:

- gcs fault set rudder --uav 3 --effectiveness 0.5 --bias-deg 1
- gcs fault set elevator --stuck-deg 5 --for-s 3
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


@app.command(name="set", epilog=_SET_EPILOG)
@station_command
def set_(
    station: Station,
    actuator: Annotated[Actuator, typer.Argument(metavar="ACTUATOR", help=_NAMES)],
    effectiveness: Annotated[
        float | None, typer.Option(metavar="SHARE", help="Remaining share of the command, 0 to 1.")
    ] = None,
    bias_deg: Annotated[
        float | None, typer.Option(metavar="DEG", help="Bias of a surface [deg].")
    ] = None,
    bias_n: Annotated[
        float | None, typer.Option(metavar="N", help="Bias of the throttle [N].")
    ] = None,
    stuck_deg: Annotated[
        float | None, typer.Option(metavar="DEG", help="Stuck surface: angle [deg].")
    ] = None,
    stuck_n: Annotated[
        float | None, typer.Option(metavar="N", help="Stuck throttle: thrust [N].")
    ] = None,
    frequency_hz: Annotated[
        float,
        typer.Option(metavar="HZ", help="Let the bias or stuck value oscillate [Hz], 0 to 500."),
    ] = 0.0,
    start_s: Annotated[
        float | None, typer.Option(metavar="S", help="Start in simulated time [s]; now by default.")
    ] = None,
    end_s: Annotated[
        float | None,
        typer.Option(metavar="S", help="End in simulated time [s]; until cleared by default."),
    ] = None,
    for_s: Annotated[
        float | None,
        typer.Option(metavar="S", help="Duration in simulated time [s], instead of --end-s."),
    ] = None,
) -> None:
    """Set an actuator fault: applied = effectiveness · commanded + bias, or a stuck value.

    A fault replaces older ones of the same actuator that overlap it in time.
    """
    if for_s is not None:
        if end_s is not None:
            raise BadInput("--end-s and --for-s both set the end", "leave one of them out")
        if not 0.0 < for_s < math.inf:
            raise BadInput(f"--for-s: expected more than 0 s, got {for_s:g}")
        end_s = None if start_s is None else start_s + for_s
    keys = {
        "actuator": actuator,
        "effectiveness": effectiveness,
        "bias_deg": bias_deg,
        "bias_n": bias_n,
        "stuck_deg": stuck_deg,
        "stuck_n": stuck_n,
        "frequency_hz": frequency_hz,
        "start_s": start_s,
        "end_s": end_s,
    }
    fault = _checked(keys)

    async def action(vehicle: Vehicle) -> str:
        timed = fault
        if start_s is None and for_s is not None:
            timed = replace(fault, end_s=await _time_s(vehicle) + for_s)
        await vehicle.set_fault(timed)
        return f"UAV {vehicle.system}: {describe_fault(timed)}"

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
        faults = [fault_dict(fault, time_s) for fault in vehicle.state.faults or ()]
        return {"time_s": time_s, "faults": faults}

    station.act(action, data)


def _checked(keys: dict[str, Any]) -> Fault:
    """Return the fault with these keys, as options give them.

    Raises:
        BadInput: They do not go together; every problem is named.
    """
    from pydantic import ValidationError  # models take longer to make than commands to send

    from mavlink_defs.fault_spec import FaultSpec

    try:
        return FaultSpec.model_validate(keys).command()
    except ValidationError as error:
        from mavlink_defs.config.files import problems_of

        options = {key: f"--{key.replace('_', '-')}" for key in keys}
        lines = [problem.line(options) for problem in problems_of(FaultSpec, error)]
        raise BadInput("\n".join(lines)) from None


async def _time_s(vehicle: Vehicle) -> float:
    """Request and return its simulated time [s]."""
    await vehicle.request(dialect.MAVLINK_MSG_ID_FTC_EVENTS)
    if (time_s := vehicle.state.time_s) is None:
        raise NoAnswer(f"UAV {vehicle.system} did not tell its simulated time")
    return time_s


def _with_phase(fault: Fault, time_s: float) -> str:
    phase = "waiting" if time_s <= fault.start_s else "active" if time_s <= fault.end_s else "over"
    return f"{describe_fault(fault)}, {phase}"
