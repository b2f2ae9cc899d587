"""``gcs param list|get|set``: parameters of vehicles."""

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gcs.commands.station import EXIT_STATUS, Station, station_command
from gcs.errors import CommandRefused
from gcs.station.notifications import enum_name
from gcs.station.vehicle import Vehicle
from mavlink_defs import dialect
from mavlink_defs.services.param import Param

if TYPE_CHECKING:
    from mavlink_defs.config.quantity import Quantity

__all__ = ["app"]

app = typer.Typer(help="List, read and set parameters.", no_args_is_help=True)

_Name = Annotated[str, typer.Argument(metavar="NAME", help="Name, at most 16 characters.")]

_LIST_EPILOG = f"""
Examples:

- gcs param list --uav 1
- gcs param list --json | jq '.[].params | length'
{EXIT_STATUS}"""

_GET_EPILOG = f"""
Examples:

- gcs param get TRIG_B1
- gcs param get TRIG_B1 --uav 2 --json
{EXIT_STATUS}"""

_SET_EPILOG = f"""
Examples:

- gcs param set TRIG_B1 0.02
- gcs param set TRIG_B1 0.02 --uav 1,3
{EXIT_STATUS}"""


@app.command(name="list", epilog=_LIST_EPILOG)
@partial(station_command, timeout_s=30.0)
def list_(station: Station) -> None:
    """List all parameters."""
    found: dict[int, tuple[Param, ...]] = {}

    async def action(vehicle: Vehicle) -> str:
        known = _known_quantities()
        params = found[vehicle.system] = await vehicle.list_params()
        return "\n".join(_words(vehicle, param, known(param.name)) for param in params)

    def data(vehicle: Vehicle) -> dict[str, Any]:
        return {"params": [_param_dict(param) for param in found[vehicle.system]]}

    station.act(action, data)


@app.command(epilog=_GET_EPILOG)
@station_command
def get(
    station: Station,
    name: _Name,
) -> None:
    """Read one parameter."""
    found: dict[int, Param] = {}

    async def action(vehicle: Vehicle) -> str:
        known = _known_quantities()
        param = found[vehicle.system] = await vehicle.get_param(name)
        return _words(vehicle, param, known(param.name))

    station.act(action, lambda vehicle: _param_dict(found[vehicle.system]))


@app.command(  # a negative value is not an option
    name="set", epilog=_SET_EPILOG, context_settings={"ignore_unknown_options": True}
)
@station_command
def set_(
    station: Station,
    name: _Name,
    value: Annotated[
        float, typer.Argument(metavar="VALUE", help="New value, in the unit of the parameter.")
    ],
) -> None:
    """Set one parameter; the vehicle checks its range."""
    found: dict[int, Param] = {}

    async def action(vehicle: Vehicle) -> str:
        known = _known_quantities()(name)
        try:
            param = found[vehicle.system] = await vehicle.set_param(name, value)
        except CommandRefused as problem:
            if problem.result != dialect.MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE or known is None:
                raise
            raise CommandRefused(f"{problem}: expected {known.range()}", problem.result) from None
        return _words(vehicle, param, known)

    station.act(action, lambda vehicle: _param_dict(found[vehicle.system]))


def _known_quantities() -> Callable[[str], "Quantity | None"]:
    """Import what is known of parameters: with the laws, once vehicles have been heard.

    An action calls it before it sends anything, as no answer is received during an import.
    """
    from gcs.station.param_metadata import known_quantity

    return known_quantity


def _words(vehicle: Vehicle, param: Param, known: "Quantity | None") -> str:
    unit = f" {known.unit}" if known and known.unit else ""
    allowed = known.range() if known else "any number"
    limits = "" if allowed.startswith("any number") else f" ({allowed})"
    meaning = f"; {known.doc.rstrip('.')}" if known and known.doc else ""
    return f"UAV {vehicle.system}: {param.name} = {param.value:g}{unit}{limits}{meaning}"


def _param_dict(param: Param) -> dict[str, Any]:
    kind = enum_name("MAV_PARAM_TYPE", param.type, "MAV_PARAM_TYPE_").lower()
    return {"name": param.name, "value": param.value, "type": kind}
