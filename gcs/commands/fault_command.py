"""What `gcs fault set` and `gcs fault sensor set` share: options of their numbers, the order."""

import inspect
import math
from collections.abc import Iterator, Mapping
from typing import Annotated, Any

import typer
from pydantic import ValidationError

from gcs.commands.station import StationOptions
from gcs.console.errors import BadInput, NoAnswer
from gcs.station.vehicle import Vehicle
from mavlink_defs import dialect
from mavlink_defs.config.files import problems_of
from mavlink_defs.config.quantity import describe
from mavlink_defs.faults.fault import Fault
from mavlink_defs.faults.spec import ActuatorFaultSpec, FaultSpec

ForOption = Annotated[
    float | None,
    typer.Option(metavar="S", help="Duration in simulated time [s], instead of --end-s."),
]


def number_options(model: type[FaultSpec], *, hidden: bool = False) -> Iterator[inspect.Parameter]:
    """Yield an option for each number of a fault; hidden, only what no fault of an actuator has."""
    for name, field in model.model_fields.items():
        number = describe(field)
        if (
            number is None
            or name == "instance"
            or (hidden and name in ActuatorFaultSpec.model_fields)
        ):
            continue
        limits = number.range() if number.le is not None else f"[{number.unit}]"
        metavar = (number.unit or ("share" if model is ActuatorFaultSpec else "factor")).upper()
        doc = f"{number.doc.rstrip('.')} {limits}."
        option = typer.Option(metavar=metavar, help=doc, hidden=hidden)
        yield inspect.Parameter(
            name,
            inspect.Parameter.KEYWORD_ONLY,
            default=field.default,
            annotation=Annotated[float | None, option],
        )


def set_fault(
    station: StationOptions,
    model: type[FaultSpec],
    whose: Mapping[str, str],
    options: Mapping[str, Any],
    for_s: float | None,
) -> None:
    """Set the fault that options describe, at every chosen vehicle.

    Args:
        station: Reaches the vehicles.
        model: Of a fault of an actuator, or of a sensor.
        whose: Key and name of it.
        options: The others; None: not given.
        for_s: Duration [s] instead of an end.

    Raises:
        BadInput: They do not go together; every problem is named.
    """
    start_s, given = options["start_s"], dict(options)
    if for_s is not None:
        if options["end_s"] is not None:
            raise BadInput("--end-s and --for-s both set the end", "leave one of them out")
        if not 0.0 < for_s < math.inf:
            raise BadInput(f"--for-s: expected more than 0 s, got {for_s:g}")
        given["end_s"] = None if start_s is None else start_s + for_s
    fault = _fault(model, whose, given)

    async def action(vehicle: Vehicle) -> str:
        timed = fault
        if start_s is None and for_s is not None:
            timed = fault._replace(end_s=await time_s(vehicle) + for_s)
        await vehicle.set_fault(timed)
        return f"UAV {vehicle.system}: {timed.describe()}"

    station.act(action)


def _fault(model: type[FaultSpec], whose: Mapping[str, str], options: Mapping[str, Any]) -> Fault:
    names = {key: f"--{key.replace('_', '-')}" for key in options}
    given = {
        key: value
        for key, value in options.items()
        if value is not None and (value != 0.0 or key != "frequency_hz")
    }
    unfit = [names[key] for key in given if key not in model.model_fields]
    if unfit:
        kind, other = "a sensor", "set"
        if model is ActuatorFaultSpec:
            kind, other = "an actuator", "sensor set"
        text = "\n".join(f"{name}: does not fit {kind}" for name in unfit)
        raise BadInput(text, f"see `gcs fault {other} --help`")
    try:
        return model.model_validate({**whose, **given}).command()
    except ValidationError as error:
        lines = [problem.line(names) for problem in problems_of(model, error)]
        raise BadInput("\n".join(lines)) from None


async def time_s(vehicle: Vehicle) -> float:
    """Request and return its simulated time [s]."""
    await vehicle.request(dialect.MAVLINK_MSG_ID_FTC_EVENTS)
    if (now_s := vehicle.state.time_s) is None:
        raise NoAnswer(f"UAV {vehicle.system} did not report its simulated time")
    return now_s
