"""What a flight is said to take on disk is at least what it takes, and not much more."""

import asyncio
import shutil
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from ftc_lab.baselines.senders import periodic_base
from gcs.commands import cli
from gcs.fleet.disk_space import folder_bytes
from gcs.fleet.flight import fly_over_udp
from gcs.fleet.in_process import fly_in_steps
from gcs.fleet.ports import on_free_ports
from gcs.reports.figures.overview import draw_flight
from gcs.results.choices import Record
from gcs.results.recorder import FlightRecorder
from gcs.results.recording import Ending, Steps
from gcs.scenario.model import Scenario

SLACK = 4e6  # for figures, and for what waits of each aircraft to be put together
SCENARIO_1 = "paper/scenario1"
FIGURES: dict[str, int] = {}
"""Bytes of the figures of each flight that was drawn: drawing takes longer than flying."""


def size_of(folder: Path) -> int:
    """Bytes of all files of a folder, some of which may be removed meanwhile."""
    sizes = []
    for path in folder.rglob("*"):
        try:
            sizes.append(path.stat().st_size if path.is_file() else 0)
        except FileNotFoundError:
            continue
    return sum(sizes)


def flown(scenario: Scenario, folder: Path, record: Record, over_udp: bool, restart: bool) -> int:
    """Fly, and return the most that was seen on disk."""
    recorder = FlightRecorder(scenario, folder, record)
    peak = 0

    def add(steps: Steps) -> None:
        nonlocal peak
        peak = max(peak, size_of(folder))
        recorder.add(steps)

    def fly(scenario: Scenario, _hub: object = None) -> Ending:
        if not over_udp:
            return fly_in_steps(scenario, add)
        return asyncio.run(fly_over_udp(scenario, folder, add, restart=restart))

    ending = on_free_ports(scenario, fly) if over_udp else fly(scenario)
    recorder.finish(ending)
    drawn = scenario.model_dump_json()  # not by the record: what is drawn is the same
    if drawn not in FIGURES:
        before = size_of(folder)
        preview = recorder.preview
        draw_flight(preview.recording(ending), scenario, preview.gaps(), folder)
        FIGURES[drawn] = size_of(folder) - before
        return max(peak, size_of(folder))
    return max(peak, size_of(folder) + FIGURES[drawn])


@pytest.fixture(params=["by events", "by the clock"])
def scenario(request: pytest.FixtureRequest, scenario1: Scenario) -> Scenario:
    scenario = scenario1.model_copy(update={"duration_s": 4.0, "faults": ()})
    by_clock = request.param == "by the clock"
    return periodic_base(scenario, Path("base"), {}) if by_clock else scenario


@pytest.mark.parametrize("record", Record)
def test_a_flight_in_process(scenario: Scenario, tmp_path: Path, record: Record) -> None:
    estimate = folder_bytes(scenario, record, over_udp=False)
    taken = flown(scenario, tmp_path, record, over_udp=False, restart=False)
    assert taken <= estimate <= 3 * taken + SLACK * (1 + len(scenario.uavs))


@pytest.mark.sitl
@pytest.mark.parametrize(
    ("record", "restart"), [(Record.LIGHT, False), (Record.FULL, True), (Record.NONE, False)]
)
def test_a_flight_of_processes(
    scenario1: Scenario, tmp_path: Path, record: Record, restart: bool
) -> None:
    scenario = scenario1.model_copy(update={"duration_s": 3.0, "faults": ()})
    estimate = folder_bytes(scenario, record, restart=restart)
    taken = flown(scenario, tmp_path, record, over_udp=True, restart=restart)
    assert taken <= estimate <= 3 * taken + SLACK * (1 + len(scenario.uavs))


@pytest.mark.parametrize("record", Record)
def test_everything_counts(scenario1: Scenario, record: Record) -> None:
    base = folder_bytes(scenario1, record, over_udp=False)
    longer = scenario1.model_copy(update={"duration_s": 10 * scenario1.duration_s})
    fewer = scenario1.model_copy(update={"uavs": scenario1.uavs[:1]})
    assert folder_bytes(fewer, record, over_udp=False) < base
    assert base < folder_bytes(scenario1, record) < folder_bytes(scenario1, record, restart=True)
    assert folder_bytes(scenario1, record) < folder_bytes(longer, record)
    assert folder_bytes(scenario1, Record.NONE) <= folder_bytes(scenario1, record)


@pytest.mark.parametrize("options", [("--in-process",), ("--free-ports", "--restart=on-failure")])
def test_a_flight_without_room_on_disk_is_refused_beforehand(
    scenario1: Scenario,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    options: tuple[str, ...],
) -> None:
    wire = "--in-process" not in options
    needed = folder_bytes(scenario1, Record.FULL, over_udp=wire, restart=wire)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: SimpleNamespace(free=needed - 1))
    out = tmp_path / "run"
    monkeypatch.setattr(
        sys, "argv", ["gcs", "fly", SCENARIO_1, *options, "--record", "full", "--out", str(out)]
    )
    with pytest.raises(SystemExit) as ended:
        cli.main()
    assert ended.value.code == 2
    said = " ".join(capsys.readouterr().err.split())
    assert f"the flight needs about {needed / 1e6:.1f} MB on disk" in said
    assert f"{out} has {(needed - 1) / 1e6:.1f} MB left" in said
    assert not out.exists()
