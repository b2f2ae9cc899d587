"""A log whose fault is found, replayed and flown by other laws."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ftc_lab.fault_replay.found import FoundFault, check_commands, fault_of, with_wind
from ftc_lab.fault_replay.replay import (
    LogMotion,
    Replayed,
    ReplayErrors,
    ServoTimes,
    errors_of,
    times_by,
)
from ftc_lab.fault_replay.scenarios import LEAD_S, FlownLaw, fly_law, scenario_for, scenario_of_run
from ftc_lab.flight_diagnosis.by_model import flown_run
from ftc_lab.identification.from_log import identify_log
from ftc_lab.identification.identified import Identified
from gcs.console.errors import BadInput
from gcs.results.logs.read import read_flight
from gcs.results.logs.table import FlightTable
from gcs.results.run_folder import SCENARIO
from gcs.scenario.model import read_scenario
from sitl_plant.airframe.config import Aircraft

_MOST_S = 60.0  # of the log after the onset that is replayed


@dataclass(frozen=True)
class ReadFault:
    """A log, its aircraft and its fault.

    Attributes:
        path: The file or folder.
        uav: System id of the aircraft, in a flight of ours.
        log: Its motion and commands.
        title: Of the log.
        fault: What failed.
        identified: How the aircraft was identified; None: it is as given.
        remarks: What was taken for what, and what the log lacks.
    """

    path: Path
    uav: int
    log: LogMotion
    title: str
    fault: FoundFault
    identified: Identified | None
    remarks: tuple[str, ...]

    @property
    def is_run(self) -> bool:
        """Whether it is a run folder of ours, whose scenario is flown again."""
        return (self.path / SCENARIO).exists()


@dataclass(frozen=True)
class ReplayedFault:
    """All that is said of a fault that was flown again.

    Attributes:
        read: The log and the fault.
        recorded: What the aircraft did.
        model: What the model did under its commands, with the fault.
        errors: How far that is from what the aircraft did.
        laws: Flights by other laws.
    """

    read: ReadFault
    recorded: Replayed
    model: Replayed
    errors: ReplayErrors
    laws: tuple[FlownLaw, ...]


def read_fault(
    path: Path, nominal: Aircraft | None, uav: int | None, columns: Path | None, *, identify: bool
) -> ReadFault:
    """Read a log, identify its aircraft while it is healthy, and find what failed.

    Args:
        path: The log, or a run folder of ours.
        nominal: The aircraft as it is known; None: the one of a run folder.
        uav: System id, where a log has several.
        columns: A column map.
        identify: Whether the coefficients of `nominal` are identified from the log.

    Raises:
        BadInput: The log lacks something, or nothing failed in it.
    """
    log, servos, number = read_flight(path, uav, columns), ServoTimes(), uav or 1
    if (path / SCENARIO).exists():
        flown = read_scenario(path / SCENARIO)
        number = uav or flown.uavs[0].id
        log = flown_run(path, log, number)
        nominal, identify = nominal or flown.aircraft_of(number), False
        own = flown.servos_of(number)
        surfaces = own.aileron.lag_s, own.elevator.lag_s, own.rudder.lag_s
        servos = ServoTimes(0.0, (*surfaces, own.throttle.lag_s))
    if nominal is None:
        text = "--aircraft is missing: a log has neither mass nor size"
        raise BadInput(text, f"as in gcs replay-fault {path} --aircraft aerosonde")
    check_commands(log, nominal)
    log, wind = with_wind(log, nominal)
    fault = fault_of(log, nominal)
    found, remarks = None, [wind, *log.remarks]
    if identify:
        found, text = _identified(log, nominal, None if fault is None else fault.onset_s)
        remarks.append(text)
        if found is not None:
            nominal = found.aircraft
            servos = times_by(found.evidence.shifts_s if found.evidence else {})
            fault = fault_of(log, nominal) or fault
    if fault is None:
        text = f"nothing failed in {log.title} that it would show by the model"
        raise BadInput(
            f"{text}: there is no fault to fly again", "`gcs diagnose` says what was judged"
        )
    motion = LogMotion(log, nominal, servos)
    return ReadFault(path, number, motion, log.title, fault, found, tuple(remarks))


def _identified(
    log: FlightTable, nominal: Aircraft, until_s: float | None
) -> tuple[Identified | None, str]:
    """Return what the healthy part of a log shows of the aircraft, and a remark."""
    healthy = log if until_s is None else _until(log, until_s)
    try:
        return identify_log(healthy, nominal), "the aircraft is identified from the healthy part"
    except BadInput as problem:
        return None, f"the aircraft is as given, as it cannot be identified: {problem}"


def _until(log: FlightTable, end_s: float) -> FlightTable:
    """Return a log without what is later than a time."""
    channels = {}
    for name, one in log.channels.items():
        kept = one.time_s <= end_s
        if kept.any():
            channels[name] = replace(one, time_s=one.time_s[kept], values=one.values[kept])
    return replace(log, channels=channels)


def replay_fault(read: ReadFault, laws: Sequence[str], folder: Path) -> ReplayedFault:
    """Fly a fault again: the model under the recorded commands, and other laws.

    Args:
        read: The log and its fault.
        laws: Names of the laws.
        folder: Where scenario files and runs go.

    Raises:
        BadInput: A law cannot fly the aircraft, or the log has a gap at the onset.
    """
    log, fault = read.log, read.fault
    begin = log.index(fault.onset_s - LEAD_S)
    if not log.known[begin]:
        raise BadInput(
            f"{read.title} has a gap {LEAD_S:g} s before the fault: nothing to start from"
        )
    end = log.index(fault.onset_s + _MOST_S)
    unknown = np.flatnonzero(~log.known[begin:end])
    end = begin + int(unknown[0]) if len(unknown) else end
    made = []
    for law in laws:
        if read.is_run:
            scenario, zero_s = scenario_of_run(read.path, fault, read.uav, law), 0.0
        else:
            scenario = scenario_for(log, fault, law, read.title)
            zero_s = float(log.time_s[begin])
        made.append(fly_law(scenario, law, read.uav if read.is_run else 1, folder, zero_s))
    return ReplayedFault(
        read,
        log.recorded(begin, end),
        log.flown(begin, end, fault),
        errors_of(log, begin, end, fault),
        tuple(made),
    )
