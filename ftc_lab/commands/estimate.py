"""``gcs estimate``: the autopilot's estimator over what the sensors of a flight reported."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from ftc_lab.written_files import check_picture, save_picture
from gcs.commands.common import QuietOption
from gcs.commands.options import JsonOption, LogColumnsOption, LogUavOption
from gcs.console.lines import print_json
from gcs.console.progress import working
from gcs.console.terminal import console_of, numbers, table_of, texts

if TYPE_CHECKING:
    from ftc_lab.flight_estimation.estimated import FlightEstimate
    from gcs.console.terminal import Terminal


def estimate(
    flight: Annotated[Path, typer.Argument(metavar="FLIGHT", show_default=False)],
    uav: LogUavOption = None,
    columns: LogColumnsOption = None,
    aircraft: Annotated[str | None, typer.Option(metavar="AIRCRAFT", show_default=False)] = None,
    latency: Annotated[float, typer.Option(min=0.0, max=1.0, metavar="S")] = 0.0,
    compass: Annotated[Literal["calibrated", "raw", "none"], typer.Option()] = "calibrated",
    sensors: Annotated[Path | None, typer.Option(metavar="FILE", show_default=False)] = None,
    start: Annotated[float | None, typer.Option(metavar="S", show_default=False)] = None,
    end: Annotated[float | None, typer.Option(metavar="S", show_default=False)] = None,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", metavar="FILE", show_default=False)
    ] = None,
    quiet: QuietOption = False,
    as_json: JsonOption = False,
) -> None:
    """Estimate a flight by its recorded sensors.

    The estimator of our autopilots follows IMU, GNSS, pitot tube, barometer and compass of a log,
    step by step and without looking ahead, and joins the aircraft in the air. Its angles,
    velocities and wind are compared with the log's own solution where there is one, the
    innovations of each sensor with what the filter expects; and it is said which sensors were
    excluded, and when.

    Args:
        flight: Log of a flight: .tlog, .bin, .ulg, .csv, .parquet, .mat.
        aircraft: The aircraft as it is known, a bundled one or a file; without it, any that
            carries itself at the usual airspeed.
        latency: How old GNSS fixes are when the log has them, to some 0.3 s: turns show the rest.
        compass: Its readings with hard iron and scale taken off, by this flight, as they are, or
            not at all.
        sensors: What is assumed of the sensors (YAML), keys as of `sensors.navigation`.
        start: Where to begin in the log; by default after take-off.
        end: Where to end; by default before touch-down.
        out: Picture of errors, wind and exclusions to write (.png, .svg, .pdf); by default none.

    Examples:
        - gcs estimate flight.ulg
        - gcs estimate flight.bin --latency 0.2 --compass raw --out errors.png
        - gcs estimate flight.mat --aircraft mine.yaml --json | jq .errors.roll

    Exit status: 0 the log's own solution says the same within 5 deg (95 % of roll and pitch) and
    10 deg (yaw), or there is none; 1 it does not, or the filter was lost; 2 bad input.
    """
    from ftc_lab.flight_estimation.estimated import estimate_flight
    from gcs.results.logs.read import read_flight
    from gcs.scenario.aircraft_file import load_aircraft
    from mavlink_defs.config.files import load
    from sitl_plant.sensing.config import NavigationSensors

    check_picture(out)
    console = console_of(quiet=quiet)
    nominal = None if aircraft is None else load_aircraft(aircraft)
    own = None if sensors is None else load(sensors, NavigationSensors)
    with working(console, "reading the flight"):
        log = read_flight(flight, uav, columns)
    with working(console, "estimating"):
        found = estimate_flight(log, nominal, latency, compass, own, (start, end))
    if out is not None:
        from ftc_lab.figures.estimate import draw_estimate

        save_picture(out, draw_estimate(found, log))
    if as_json:
        print_json(_json(found), indent=2)
    else:
        _print(found, console_of(stderr=False, quiet=quiet))
        for remark in (*found.remarks, *log.remarks):
            console.print(f"remark: {remark}", soft_wrap=True)
    if not found.judged.agrees:
        raise typer.Exit(1)


def _json(found: "FlightEstimate") -> dict[str, object]:
    judged = found.judged
    return {
        "agrees": judged.agrees,
        "judged_from_s": judged.span_s[0],
        "judged_to_s": judged.span_s[1],
        "errors": {name: one._asdict() for name, one in judged.errors.items()},
        "own_std_deg": dict(zip(("roll", "pitch", "yaw"), judged.expected_deg, strict=True)),
        "nis": {name: one._asdict() for name, one in judged.nis.items()},
        "exclusions": [one._asdict() for one in judged.exclusions],
        "resets": judged.resets,
        "lost_s": judged.lost_s,
        "latency_s": {
            "taken": found.latency_s,
            "learnt": found.learnt_s,
            "learnt_std": found.learnt_std_s,
        },
        "remarks": list(found.remarks),
    }


def _print(found: "FlightEstimate", output: "Terminal") -> None:
    judged = found.judged
    table = table_of(
        texts("estimated less recorded"),
        numbers("median"),
        numbers("95 %"),
        numbers("largest"),
        texts(""),
    )
    for name, one in judged.errors.items():
        sizes = (f"{size:.2f}" for size in one[:3])
        table.add_row(name, *sizes, one.unit)
    if judged.errors:
        output.print(table)
    else:
        output.print("The log has no solution of its own: nothing to compare with.")
    table = table_of(
        texts("sensor"),
        numbers("mean NIS"),
        numbers("expected"),
        numbers("95 % of means"),
        numbers("samples"),
    )
    for sensor, nis in judged.nis.items():
        low, high = nis.bounds
        bounds = f"{low:.2f} to {high:.2f}"
        table.add_row(sensor, f"{nis.mean:.2f}", f"{nis.expected:.2f}", bounds, f"{nis.samples}")
    output.print(table)
    for out in judged.exclusions:
        output.print(
            f"{out.sensor} not used from {out.from_s:.1f} to {out.to_s:.1f} s: {out.reason}"
        )
    for line in _verdict(found):
        output.print(line, soft_wrap=True)


def _verdict(found: "FlightEstimate") -> "list[str]":
    """Return what is to be said, in lines."""
    judged = found.judged
    lines = [
        f"Judged from {judged.span_s[0]:.0f} to {judged.span_s[1]:.0f} s; the filter's own "
        "standard deviations of roll, pitch, yaw are {:.1f}, {:.1f}, {:.1f} deg.".format(
            *judged.expected_deg
        ),
        f"Latency of the receiver: {found.latency_s:.2f} s taken, "
        f"{found.learnt_s:.3f} ± {found.learnt_std_s:.3f} s learnt.",
    ]
    if judged.resets:
        lines.append(f"The filter was set to a fix, or began again, {judged.resets} times.")
    if judged.lost_s is not None:
        lines.append(f"LOST: from {judged.lost_s:.1f} s on, the estimate is no number.")
    elif judged.errors:
        agrees = "agree" if judged.agrees else "do NOT agree"
        lines.append(f"The estimate and the log's own solution {agrees}.")
    return lines
