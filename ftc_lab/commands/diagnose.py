"""``gcs diagnose``: what failed in a recorded flight, when, and how sure that is."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ftc_lab.written_files import check_picture, save_picture
from gcs.commands.common import QuietOption
from gcs.commands.options import JsonOption, LogColumnsOption, LogUavOption
from gcs.console.errors import BadInput
from gcs.console.lines import print_json
from gcs.console.progress import working
from gcs.console.terminal import console_of, numbers, table_of, texts

if TYPE_CHECKING:
    from ftc_lab.flight_diagnosis.decisions import Diagnosis, Learnt, Watched
    from ftc_lab.flight_diagnosis.relations import Relations, Surface
    from gcs.console.terminal import Terminal
    from gcs.results.logs.table import FlightTable


def diagnose(
    flight: Annotated[Path, typer.Argument(metavar="FLIGHT", show_default=False)],
    uav: LogUavOption = None,
    columns: LogColumnsOption = None,
    aircraft: Annotated[str | None, typer.Option(metavar="AIRCRAFT", show_default=False)] = None,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", metavar="FILE", show_default=False)
    ] = None,
    quiet: QuietOption = False,
    as_json: JsonOption = False,
) -> None:
    """Say what failed in a flight, and when.

    Engine, aileron, elevator and rudder are judged, each by a relation between recorded signals
    that the flight itself teaches while it is healthy: some 25 s of flight are needed first.
    Nothing of the aircraft has to be known. What the log does not show is said, not guessed; left
    and right look the same. How large evidence is in healthy flights, and how probable a fault is
    then, was learnt from flights of one aircraft.

    Args:
        flight: Log of a flight: .tlog, .bin, .ulg, .csv, .parquet, .mat, or a run folder.
        aircraft: Judge by a model of the aircraft, a bundled one or a file: needs commands to the
            actuators and the wind, and takes seconds in place of half a minute. Of a run folder, by
            default the one that its laws knew.
        out: Picture of the evidence to write (.png, .svg, .pdf); by default none.

    Examples:
        - gcs diagnose flight.bin
        - gcs diagnose flight.csv --columns mine.yaml --out evidence.png
        - gcs diagnose flight.ulg --json | jq .finding

    Exit status: 0 nothing was found, 1 something failed, 2 bad input, or nothing that can be
    judged.
    """
    from ftc_lab.flight_diagnosis.decisions import diagnose_flight, learnt, watch

    check_picture(out)
    console = console_of(quiet=quiet)
    with working(console, "reading the flight"):
        log, relations = _read(flight, uav, columns, aircraft)
    with working(console, "diagnosing"):
        watched = watch(relations)
    if not watched:
        text = f"{flight} is too short: all of it is needed to learn what is healthy"
        raise BadInput(text, "by a model (--aircraft) some 5 s are, else some 25 s of flight")
    known = learnt(relations)
    diagnosis = diagnose_flight(relations, watched, known)
    if out is not None:
        from ftc_lab.figures.diagnosis import draw_diagnosis

        save_picture(out, draw_diagnosis(watched, diagnosis))
    if as_json:
        print_json(_json(watched, diagnosis, log.remarks), indent=2)
    else:
        _print(console_of(stderr=False, quiet=quiet), watched, diagnosis, known)
        for remark in log.remarks:
            console.print(f"remark: {remark}", soft_wrap=True)
    if diagnosis.finding is not None:
        raise typer.Exit(1)


def _read(
    flight: Path, uav: int | None, columns: Path | None, aircraft: str | None
) -> "tuple[FlightTable, Relations]":
    """Return a log, and its relations by a model if there is one, else those that it shows."""
    from ftc_lab.flight_diagnosis.by_model import flown_run, relations_by_model
    from ftc_lab.flight_diagnosis.relations import relations_of
    from gcs.results.logs.read import read_flight
    from gcs.results.run_folder import SCENARIO
    from gcs.scenario.aircraft_file import load_aircraft
    from gcs.scenario.model import read_scenario

    nominal = None if aircraft is None else load_aircraft(aircraft)
    log = read_flight(flight, uav, columns)
    if (flight / SCENARIO).exists():
        flown = read_scenario(flight / SCENARIO)
        log = flown_run(flight, log, uav)
        nominal = nominal or flown.aircraft_of(uav or flown.uavs[0].id)
    return log, relations_of(log) if nominal is None else relations_by_model(log, nominal)


def _json(
    watched: "Mapping[Surface, Watched]", diagnosis: "Diagnosis", remarks: Sequence[str]
) -> dict[str, object]:
    found = diagnosis.finding
    return {
        "failed": found is not None,
        "probability": round(diagnosis.probability, 3),
        "finding": None
        if found is None
        else {
            "surface": found.surface,
            "onset_s": round(found.onset_s, 2),
            "onset_between_s": [round(one, 2) for one in found.between_s],
            "alarm_s": round(found.alarm_s, 2),
            "evidence": round(found.ratios[found.surface], 2),
            "probabilities": {name: round(p, 3) for name, p in found.probabilities.items()},
        },
        "surfaces": {
            surface: {
                "judged_by": one.relation.text,
                "judged_s": round(one.judged_s, 1),
                "largest_evidence": round(float(diagnosis.ratios[surface].max()), 2),
                "at_s": round(float(diagnosis.time_s[diagnosis.ratios[surface].argmax()]), 2),
            }
            for surface, one in watched.items()
        },
        "not_judged": list(diagnosis.cannot),
        "remarks": list(remarks),
    }


def _print(
    output: "Terminal",
    watched: "Mapping[Surface, Watched]",
    diagnosis: "Diagnosis",
    known: "Learnt",
) -> None:
    table = table_of(
        texts("surface"),
        texts("judged by"),
        numbers("for [s]"),
        numbers("largest evidence / threshold"),
        numbers("at [s]"),
    )
    for surface, one in watched.items():
        ratios = diagnosis.ratios[surface]
        at = diagnosis.time_s[ratios.argmax()]
        length = f"{one.judged_s:.0f}"
        table.add_row(surface, one.relation.text, length, f"{ratios.max():.2f}", f"{at:.1f}")
    output.print(table)
    for line in (*diagnosis.cannot, *_verdict(diagnosis, known)):
        output.print(line, soft_wrap=True)


def _verdict(diagnosis: "Diagnosis", known: "Learnt") -> Iterator[str]:
    """Yield the verdict, in lines."""
    found = diagnosis.finding
    if found is None:
        yield "Nothing failed that this log would show."
    else:
        also = ", or what is not judged," if diagnosis.cannot else ""
        yield (
            f"The {found.surface}{also} failed at {found.onset_s:.1f} s ({found.between_s[0]:.1f} "
            f"to {found.between_s[1]:.1f} s); alarm at {found.alarm_s:.1f} s, then "
            f"{found.ratios[found.surface]:.1f} times the threshold."
        )
    yield (
        f"A fault is {diagnosis.probability:.0%} probable if every second flight has one and this "
        f"is as the {known.flights} flights that it was learnt from."
    )
    if found is not None and len(found.probabilities) > 1:
        chances = sorted(found.probabilities.items(), key=lambda item: -item[1])
        yield f"If so, it is of the {', '.join(f'{name} {share:.0%}' for name, share in chances)}."
