"""``gcs param list|get|set|save|load|diff``: parameters of vehicles."""

import asyncio
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gcs.commands.station import StationOptions, station_command
from gcs.console.errors import BadInput, CommandRefused
from gcs.console.lines import print_json, print_line
from gcs.station import param_file
from gcs.station.notifications import enum_name
from gcs.station.vehicle import Vehicle
from mavlink_defs import dialect
from mavlink_defs.config.output_files import write_text
from mavlink_defs.services.param import Param

if TYPE_CHECKING:
    from gcs.station.client import Client
    from mavlink_defs.config.quantity import Quantity

app = typer.Typer(help="List, read, set, save, load and compare parameters.", no_args_is_help=True)

_Name = Annotated[str, typer.Argument(metavar="NAME", help="Name, at most 16 characters.")]

_File = Annotated[
    Path,
    typer.Argument(
        metavar="FILE",
        help="Parameter file: NAME VALUE lines (*.parm), or QGroundControl's *.params.",
    ),
]


@app.command(name="list")
@partial(station_command, timeout_s=30.0)
def list_(station: StationOptions) -> None:
    """List all parameters.

    Examples:
        - gcs param list --uav 1
        - gcs param list --json | jq '.[].params | length'
    """
    found: dict[int, tuple[Param, ...]] = {}

    async def action(vehicle: Vehicle) -> str:
        known = _known_quantities()
        params = found[vehicle.system] = await vehicle.list_params()
        return "\n".join(_text(vehicle, param, known(param.name)) for param in params)

    def data(vehicle: Vehicle) -> dict[str, Any]:
        return {"params": [_param_dict(param) for param in found[vehicle.system]]}

    station.act(action, data)


@app.command()
@station_command
def get(station: StationOptions, name: _Name) -> None:
    """Read one parameter.

    Examples:
        - gcs param get TRIG_B1
        - gcs param get TRIG_B1 --uav 2 --json
    """
    found: dict[int, Param] = {}

    async def action(vehicle: Vehicle) -> str:
        known = _known_quantities()
        param = found[vehicle.system] = await vehicle.get_param(name)
        return _text(vehicle, param, known(param.name))

    station.act(action, lambda vehicle: _param_dict(found[vehicle.system]))


@app.command("set", context_settings={"ignore_unknown_options": True})  # as a negative value
@station_command
def set_(
    station: StationOptions, name: _Name, value: Annotated[float, typer.Argument(metavar="VALUE")]
) -> None:
    """Set one parameter; the vehicle checks its range.

    Args:
        value: New value, in the unit of the parameter.

    Examples:
        - gcs param set TRIG_B1 0.02
        - gcs param set TRIG_B1 0.02 --uav 1,3
    """
    found: dict[int, Param] = {}

    async def action(vehicle: Vehicle) -> str:
        known = _known_quantities()(name)
        try:
            param = found[vehicle.system] = await vehicle.set_param(name, value)
        except CommandRefused as problem:
            if problem.result != dialect.MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE or known is None:
                raise
            raise CommandRefused(f"{problem}: expected {known.range()}", problem.result) from None
        return _text(vehicle, param, known)

    station.act(action, lambda vehicle: _param_dict(found[vehicle.system]))


def _known_quantities() -> Callable[[str], "Quantity | None"]:
    """Import what is known of parameters: with the laws, once vehicles have been heard.

    An action calls it before it sends anything, as no answer is received during an import.
    """
    from gcs.station.param_metadata import known_quantity

    return known_quantity


@app.command()
@partial(station_command, timeout_s=30.0)
def save(station: StationOptions, file: _File) -> None:
    """Save the parameters of one vehicle in a new file.

    Examples:
        - gcs param save uav1.parm --uav 1
    """
    if file.exists():
        raise BadInput(f"{file} already exists", "choose another file, or remove it")

    async def work(_: "Client", vehicles: list[Vehicle]) -> tuple[int, tuple[Param, ...]]:
        if len(vehicles) != 1:
            ids = ", ".join(str(vehicle.system) for vehicle in vehicles)
            raise BadInput(
                f"a file holds one vehicle's parameters, but UAV {ids} were heard",
                "choose one with --uav",
            )
        return vehicles[0].system, await vehicles[0].list_params()

    system, params = station.run(work)
    write_text(file, param_file.text_of(params, f"Parameters of UAV {system}"))
    if station.as_json:
        print_json({"uav": system, "file": str(file), "params": len(params)})
    else:
        print_line(f"UAV {system}: {len(params)} parameters in {file}")


@app.command()
@partial(station_command, timeout_s=30.0)
def load(
    station: StationOptions, file: _File, yes: Annotated[bool, typer.Option("--yes")] = False
) -> None:
    """Set the parameters that differ from a file; read-only ones stay as they are.

    Args:
        yes: Do not ask for confirmation.

    Examples:
        - gcs param load uav1.parm --uav 2,3
        - gcs param load uav1.parm --yes --json
    """
    values = param_file.read_settable(file)
    different = _differences(station, values)
    if not yes and any(different.values()):
        for system, held in different.items():
            for line in param_file.difference_lines(system, held, values):
                print_line(line, stderr=True)
        if not typer.confirm("Set these parameters?", err=True):
            raise BadInput("nothing was set")

    async def action(vehicle: Vehicle) -> str:
        return await param_file.set_values(vehicle, values, different[vehicle.system])

    station.act(action, lambda vehicle: {"set": {n: values[n] for n in different[vehicle.system]}})


@app.command()
@partial(station_command, timeout_s=30.0)
def diff(
    station: StationOptions,
    file: Annotated[Path | None, typer.Argument(metavar="FILE", show_default=False)] = None,
) -> None:
    """List the parameters that differ from a file, or from their defaults.

    Args:
        file: Parameter file: NAME VALUE lines (*.parm), or QGroundControl's *.params. Without one:
            the defaults, which apply where a scenario leaves a key out.

    Examples:
        - gcs param diff --uav 1
        - gcs param diff uav1.parm
        - gcs param diff uav1.parm --uav 2 --json
    """
    if file is None:
        _diff_defaults(station)
        return
    values = param_file.read_param_file(file)
    different = _differences(station, values)
    if station.as_json:
        print_json(
            [
                {"uav": i, "name": name, "held": held[name], "file": values[name]}
                for i, held in different.items()
                for name in held
            ]
        )
        return
    for system, held in different.items():
        for line in param_file.difference_lines(system, held, values):
            print_line(line)
        if not held:
            print_line(f"UAV {system}: all {len(values)} parameters as in {file}")


def _differences(
    station: StationOptions, values: dict[str, float]
) -> dict[int, dict[str, float | None]]:
    """Return for each vehicle the values held that differ from a file."""
    return {
        system: param_file.differing(params, values) for system, params in _held(station).items()
    }


def _held(station: StationOptions) -> dict[int, tuple[Param, ...]]:
    """Return the parameters of each vehicle."""

    async def work(_: "Client", vehicles: list[Vehicle]) -> dict[int, tuple[Param, ...]]:
        held = await asyncio.gather(*(vehicle.list_params() for vehicle in vehicles))
        return {v.system: params for v, params in zip(vehicles, held, strict=True)}

    return station.run(work)


def _diff_defaults(station: StationOptions) -> None:
    """List the parameters that differ from their defaults."""
    found = _held(station)
    from gcs.station.param_metadata import defaults_of, differs

    defaults = {system: defaults_of(params) for system, params in found.items()}
    for system, known in defaults.items():
        if not known:
            text = f"UAV {system}: the defaults of its parameters are not known"
            raise BadInput(text, "choose others with --uav, or compare with a file")
    different = [
        (system, param, defaults[system][param.name])
        for system, params in found.items()
        for param in params
        if differs(param, defaults[system])
    ]
    if station.as_json:
        print_json(
            [
                {"uav": system, "name": param.name, "held": param.value, "defaults": values}
                for system, param, values in different
            ]
        )
        return
    for system, param, values in different:
        values_text = ", then ".join(f"{value:.9g}" for value in values)
        print_line(param_file.difference(system, param.name, param.value, f"default {values_text}"))
    for system in sorted(found.keys() - {system for system, _, _ in different}):
        print_line(f"UAV {system}: all {len(defaults[system])} parameters with a default have it")


def _text(vehicle: Vehicle, param: Param, known: "Quantity | None") -> str:
    unit = f" {known.unit}" if known and known.unit else ""
    allowed = known.range() if known else ""
    limits = "" if not allowed or allowed.startswith("any number") else f", range {allowed}"
    limits = ", read only" if param.name in param_file.READ_ONLY else limits
    meaning = f"; {known.doc.rstrip('.')}" if known and known.doc else ""
    return f"UAV {vehicle.system}: {param.name} = {param.value:g}{unit}{limits}{meaning}"


def _param_dict(param: Param) -> dict[str, Any]:
    kind = enum_name("MAV_PARAM_TYPE", param.type, "MAV_PARAM_TYPE_").lower()
    return {"name": param.name, "value": param.value, "type": kind}
