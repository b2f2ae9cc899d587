"""``gcs formation show|slot``: the formation as its members see it, and their slots."""

import math
from typing import Annotated, Any

import typer

from gcs.commands.station import StationOptions, station_command
from gcs.console.errors import BadInput
from gcs.station.notifications import enum_name
from gcs.station.vehicle import Vehicle
from mavlink_defs import dialect

app = typer.Typer(help="See the formation in space, and change slots.", no_args_is_help=True)

_Message = dialect.MAVLink_ftc_formation_message
_Ahead = Annotated[
    float | None, typer.Argument(metavar="AHEAD", help="Along the path, negative behind [m].")
]
_Right = Annotated[
    float | None,
    typer.Argument(metavar="RIGHT", help="To the right of the path, negative to the left [m]."),
]
_Up = Annotated[
    float | None, typer.Argument(metavar="UP", help="Above the path, negative below [m].")
]


@app.command()
@station_command
def show(station: StationOptions) -> None:
    """Show each member's slot, its errors, its nearest neighbour, and its state.

    Examples:
        - gcs formation show
        - gcs formation show --uav 2 --json
    """
    found: dict[int, _Message] = {}

    async def action(vehicle: Vehicle) -> str:
        message = found[vehicle.system] = await vehicle.formation()
        return f"UAV {vehicle.system}: {_text(message)}"

    station.act(action, lambda vehicle: _data(found[vehicle.system]))


@app.command(context_settings={"ignore_unknown_options": True})  # as a negative distance
@station_command
def slot(
    station: StationOptions,
    ahead: _Ahead = None,
    right: _Right = None,
    up: _Up = None,
    planned: Annotated[bool, typer.Option("--planned")] = False,
) -> None:
    """Change the slot of a member: ahead, to the right and above the path.

    Args:
        planned: Return to the slot that the scenario plans.

    Examples:
        - gcs formation slot --uav 3 -60 20 10     (60 m behind, 20 m to the right, 10 m above)
        - gcs formation slot --uav 3 --planned
    """
    given = [distance for distance in (ahead, right, up) if distance is not None]
    if planned == bool(given) or (given and len(given) != 3):
        raise BadInput("expected three distances AHEAD RIGHT UP [m], or --planned")
    if not all(map(math.isfinite, given)):  # NaN means the planned slot
        text = " ".join(f"{distance:g}" for distance in given)
        raise BadInput(f"slot is {text}, expected finite distances [m]")
    systems = station.systems
    if not planned and (systems is None or len(systems) != 1):
        got = "none" if systems is None else ", ".join(map(str, sorted(systems)))
        raise BadInput(f"expected --uav with one UAV, as two cannot have one slot, got {got}")
    place = (math.nan,) * 3 if planned else (given[0], given[1], given[2])

    where = "the planned slot" if planned else "slot {:g} m ahead, {:g} m right, {:g} m up"
    station.do(lambda vehicle: vehicle.set_slot(*place), f"takes {where.format(*place)}")


def _text(message: _Message) -> str:
    if message.path_id == 0:
        return "flies no path in formation"
    ahead, right, up = message.slot
    text = f"slot {ahead:.1f} m ahead, {right:.1f} m right, {up:.1f} m up"
    errors = (f"{e:+.2f}" if math.isfinite(e) else "-" for e in message.slot_error)
    text += f"; off by {' '.join(errors)} m"
    if message.nearest:
        text += f"; UAV {message.nearest} is {message.distance:.1f} m away"
    if message.cause != dialect.FTC_CAUSE_WELL:
        text += f"; {_cause(message)}, policy {_policy(message)}"
    return text


def _data(message: _Message) -> dict[str, Any]:
    if message.path_id == 0:
        return {"flies_in_formation": False}
    return {
        "flies_in_formation": True,
        "path_position_m": message.path_position,
        "path_rate_m_s": message.path_rate,
        "slot_m": list(message.slot),
        "slot_error_m": [e if math.isfinite(e) else None for e in message.slot_error],
        "nearest": message.nearest or None,
        "distance_m": message.distance if message.nearest else None,
        "evading": bool(message.evading),
        "cause": _cause(message),
        "policy": _policy(message),
    }


def _cause(message: _Message) -> str:
    return enum_name("FTC_CAUSE", message.cause, "FTC_CAUSE_").lower()


def _policy(message: _Message) -> str:
    return enum_name("FTC_POLICY", message.policy, "FTC_POLICY_").lower()
