"""Fly the paper's scenarios, and every law with every trigger, and write the report in a folder."""

import csv
import itertools
import math
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from ftc_lab.baselines.combinations import combinations, fly_faults, rivals, with_slowest_equal
from ftc_lab.baselines.senders import Fly
from ftc_lab.figures.combinations import draw_combinations
from ftc_lab.figures.events import fig7, fig8, fig9
from ftc_lab.figures.trajectories import fig5
from ftc_lab.reports.combinations import combinations_csv, combinations_section
from ftc_lab.reports.markdown import html_of, save_markdown
from ftc_lab.reports.paper import CONTROLLERS, MODES, PaperResults, paper_report
from ftc_lab.reports.published_values import FIG_9
from ftc_lab.reports.theory import theory_section
from gcs.console.errors import BadInput
from gcs.fleet.in_process import fly_in_process
from gcs.reports.figures.flown import PlottedFlight
from gcs.reports.figures.style import save
from gcs.reports.figures.tracking import fig6, fig10, fig11
from gcs.results.choices import Format, Record
from gcs.results.export import convert
from gcs.results.figures import UAV_FIGURES, FlightSummary
from gcs.results.quantities import QUANTITIES, in_degrees, integrated_error
from gcs.results.recorder import FlightRecorder
from gcs.results.recording import Recording
from gcs.results.summary import summarise
from gcs.scenario.model import Scenario, load_scenario
from mavlink_defs.config.output_files import naming, write_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FILES = ("scenario1", *CONTROLLERS, *MODES)
"""Scenario files that are flown, without suffix."""

_CAPTIONS = {
    "fig5": "Fig. 5: trajectories of the formation in scenario 1, attitude at 0, 15 and 24 s.",
    "fig6": "Fig. 6: responses (a)-(d), tracking errors (e)-(h) and synchronisation errors (31), "
    "(32) (i)-(l) in scenario 1. What leaves a panel is noted over its corner.",
    "fig7": "Fig. 7: intervals between events of every channel and UAV in scenario 1.",
    "fig8": "Fig. 8: times of the events in scenario 1.",
    "fig9": "Fig. 9: number of events in scenario 1, beside the numbers printed in the paper.",
    "fig10": "Fig. 10: follower 2 in scenario 2 under the controllers compared; below, the errors.",
    "fig11": "Fig. 11: follower 2 in scenario 3 under four fault modes; below, the errors, around "
    "the time of the faults.",
}

_COMBINATIONS = (
    "Transmissions against IAE of follower 2 under every law and trigger. The line joins what "
    "no other combination beats in both numbers."
)
_FOLLOWER_2 = 3
_BUNDLED = "name the folder with --scenarios, or leave it out for the bundled ones"


@dataclass(frozen=True)
class Reproduction:
    """What was flown.

    Attributes:
        summaries: Of the paper's flights, by file name.
        flights: How many flights were flown, including the second chapter's.
    """

    summaries: Mapping[str, FlightSummary]
    flights: int


def steps(scenarios: Mapping[str, Scenario]) -> int:
    """Return how often a reproduction calls `on_step`."""
    listed = combinations(scenarios["scenario1"])
    return len(FILES) + len(_CAPTIONS) + len(listed) + len(rivals(listed)) + 3


def load_all(folder: Path) -> dict[str, Scenario]:
    """Load the scenarios, by file name.

    Raises:
        BadInput: The folder or a file does not exist.
        ConfigError: A file is wrong.
    """
    if not folder.is_dir():
        raise BadInput(
            f"there is no folder {folder}, expected the paper's scenario files there", _BUNDLED
        )
    for file in FILES:
        if not (folder / f"{file}.yaml").is_file():
            raise BadInput(f"there is no file {folder / file}.yaml", _BUNDLED)
    return {file: load_scenario(folder / f"{file}.yaml") for file in FILES}


def reproduce(
    scenarios: Mapping[str, Scenario],
    fly: Callable[[str, Scenario], Recording],
    jobs: int,
    out: Path,
    on_step: Callable[[str], None],
    *,
    faults: bool = False,
) -> Reproduction:
    """Fly everything, and write report, data and figures.

    Args:
        scenarios: By file name, as of `load_all`.
        fly: Flies one of them.
        jobs: How many flights at once.
        out: Empty folder.
        on_step: Called with the name of each finished step, as often as `steps` says.
        faults: Fly every fault file, too, under every law and trigger.
    """
    chapter = paper_chapter(scenarios, fly, jobs, out, on_step)
    flown = itertools.count(len(chapter.summaries))

    def summary_of(scenario: Scenario) -> FlightSummary:
        recording = fly_in_process(scenario)
        next(flown)
        return summarise(recording, scenario)

    with ThreadPoolExecutor(jobs) as pool:
        second = _second_chapter(
            scenarios, chapter.summaries, partial(pool.map, summary_of), out, on_step, faults
        )
    text = f"{chapter.text}\n{second}"
    save_markdown(out / "report.md", text)
    write_text(out / "report.html", html_of(text, out))
    on_step("wrote the report")
    return Reproduction(chapter.summaries, next(flown))


@dataclass(frozen=True)
class PaperChapter:
    """The report's first chapter.

    Attributes:
        summaries: Of the paper's flights, by file name.
        text: Markdown.
    """

    summaries: Mapping[str, FlightSummary]
    text: str


def paper_chapter(
    scenarios: Mapping[str, Scenario],
    fly: Callable[[str, Scenario], Recording],
    jobs: int,
    out: Path,
    on_step: Callable[[str], None],
) -> PaperChapter:
    """Fly the paper's scenarios, and write their data and figures; arguments as of `reproduce`."""
    summaries: dict[str, FlightSummary] = {}

    def fly_and_export(file: str) -> Recording:
        recording = fly(file, scenarios[file])
        folder = out / "data" / file
        folder.mkdir(parents=True, exist_ok=True)
        recorder = FlightRecorder(scenarios[file], folder, Record.LIGHT)
        recorder.add(recording.steps)
        summaries[file] = recorder.finish(recording.ending)
        for to in (Format.NPZ, Format.CSV):
            convert(folder, to, folder)
        on_step(f"flew {scenarios[file].name}")
        return recording

    with ThreadPoolExecutor(jobs) as pool:
        recordings = dict(zip(FILES, pool.map(fly_and_export, FILES), strict=True))
    summaries = {file: summaries[file] for file in FILES}
    write_summaries(out / "data" / "summary.csv", summaries)

    theory = theory_section(scenarios, recordings, out / "data" / "theory.json")
    on_step("checked the theory")
    _draw(scenarios, recordings, out / "figures", on_step)
    results = PaperResults(
        summaries=summaries,
        reference_lag=_reference_lag(recordings["scenario2_proposed"]),
        theory=theory,
        figures=_CAPTIONS,
    )
    return PaperChapter(summaries, paper_report(results))


def _second_chapter(
    scenarios: Mapping[str, Scenario],
    summaries: Mapping[str, FlightSummary],
    fly: Fly,
    out: Path,
    on_step: Callable[[str], None],
    faults: bool,
) -> str:
    """Fly every law with every trigger, and return the section of the report."""
    flown, by_clock = [], []
    listed = combinations(scenarios["scenario1"])
    against = rivals(listed)
    flights = fly(sender.scenario for _, sender in against)
    for (aircraft, sender), summary in zip(against, flights, strict=True):
        by_clock.append((aircraft, sender, summary))
        on_step(f"flew {sender.law} every {sender.period_s * 1e3:g} ms")
    for one, summary in zip(listed, fly(one.scenario for one in listed), strict=True):
        compared = with_slowest_equal(replace(one, summary=summary), by_clock, _FOLLOWER_2)
        flown.append(fly_faults(compared, fly) if faults else compared)
        on_step(f"flew {one.law}, {one.trigger}, {one.aircraft}")
    write_text(out / "data" / "combinations.csv", combinations_csv(flown))
    save(draw_combinations(flown, _FOLLOWER_2), out / "figures", "combinations")
    on_step("drew combinations")
    follower = summaries["scenario1"].uav(_FOLLOWER_2)
    iae = follower.iae if follower is not None else {}
    paper = {quantity: iae.get(quantity) or math.nan for quantity in QUANTITIES}
    return combinations_section(flown, _FOLLOWER_2, paper, _COMBINATIONS)


def _draw(
    scenarios: Mapping[str, Scenario],
    recordings: Mapping[str, Recording],
    folder: Path,
    on_step: Callable[[str], None],
) -> None:
    folder.mkdir()
    one = PlottedFlight("scenario 1", scenarios["scenario1"], recordings["scenario1"])
    compared, modes = (
        [PlottedFlight(label, scenarios[file], recordings[file]) for file, label in labels.items()]
        for labels in (CONTROLLERS, MODES)
    )
    drawings: dict[str, Callable[[], Figure]] = {
        "fig5": lambda: fig5(one),
        "fig6": lambda: fig6(one),
        "fig7": lambda: fig7(one),
        "fig8": lambda: fig8(one),
        "fig9": lambda: fig9(one, FIG_9),
        "fig10": lambda: fig10(compared),
        "fig11": lambda: fig11(modes),
    }
    for name, draw in drawings.items():
        save(draw(), folder, name)
        on_step(f"drew {name}")


def _reference_lag(recording: Recording) -> dict[str, float]:
    """Return the IAE between follower 2's commands and its filtered reference [m, deg s]."""
    last = recording.signals[:, -1]
    area = integrated_error(last["command"] - last["reference"], recording.step_us)
    return dict(zip(QUANTITIES, map(float, in_degrees(area)), strict=True))


def write_summaries(path: Path, summaries: Mapping[str, FlightSummary]) -> None:
    """Write one line per flight and UAV."""
    with naming(path), path.open("w", newline="") as file:
        writer = csv.writer(file)
        figures = [figure.heading for figure in UAV_FIGURES]
        writer.writerow(["scenario", "uav", "completed", *figures])
        for name, summary in summaries.items():
            for uav in summary.uavs:
                values = (figure.of(uav) for figure in UAV_FIGURES)
                writer.writerow([name, uav.id, summary.completed, *values])
