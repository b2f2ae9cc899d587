"""What comes before a flight: its scenario as it is flown, checked, its mark, and remarks on it."""

import contextlib
import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gcs.console.errors import BadInput
from gcs.fleet.disk_space import check_space
from gcs.fleet.foreign import check_foreign, to_start
from gcs.fleet.ports import check_ports
from gcs.fleet.remarks import WARNING, WarningRemark, exposures, remarks_of
from gcs.results.choices import Record
from gcs.results.flight_mark import FlightMark, marked
from gcs.results.recorder import trajectory_bytes
from gcs.scenario.changes import ScenarioLike, with_changes
from gcs.scenario.model import Scenario
from gcs.scenario.plugins import prepare_plugins
from gcs.scenario.settings import plain
from gcs.scenario.signing_key import signed
from mavlink_defs.endpoint import UdpAddress
from sitl_plant.simulators.config import OwnPlant

_LARGE = 100e6  # bytes of a recording that are worth a word
_MANY = 4  # autopilots for each core that are worth another


@dataclass(frozen=True)
class How:
    """How a scenario is flown.

    Attributes:
        over_udp: Plant and autopilots are processes; else all is in this one.
        speed: Real-time factor of processes; None for lockstep.
        restart: Autopilots that fail are started again.
        autopilot_processes: Processes that the autopilots share; None for one each.
        free_ports: Processes get free ports; else the scenario's.
        hub_port: Port of the hub of a fleet that stays up; None for a flight to its end.
        record: How much of the steps is recorded.
        named: Returns what one of these is called where it was asked for, for messages.
    """

    over_udp: bool = True
    speed: float | None = None
    restart: bool = False
    autopilot_processes: int | None = None
    free_ports: bool = False
    hub_port: int | None = None
    record: Record = Record.NONE
    named: Callable[[str], str] = str

    @property
    def can_share(self) -> bool:
        """Whether autopilots can share processes."""
        return self.over_udp and not self.restart and self.speed is None

    def check(self, scenario: Scenario) -> None:
        """Check that a scenario can be flown so.

        Raises:
            BadInput: It cannot, or a port is in use.
        """
        speed, count, named = self.speed, self.autopilot_processes, self.named
        if count is not None and not (self.can_share and count > 0):
            raise BadInput(
                f"{named('autopilot_processes')} is {count}, expected at least 1: autopilots share "
                "processes only in lockstep over UDP, where a step waits for all of them, and "
                "without restarts, as they end together",
                "leave it out, or fly so" if count > 0 else "",
            )
        for name in () if self.over_udp else ("speed", "restart"):
            if getattr(self, name):
                text = f"{named(name)} is of processes; a flight in process has none"
                raise BadInput(text, "leave it out, or fly over UDP")
        check_foreign(scenario, over_udp=self.over_udp, attended=True)
        if speed is not None and not 0.0 < speed < math.inf:
            raise BadInput(
                f"{named('speed')} is {speed:g}, expected a factor above 0", "1 is real time"
            )
        if not self.over_udp and scenario.links.impairments is not None:
            text = "links.impairments apply to the wire; a flight in process has none"
            raise BadInput(text, "leave them out, or fly over UDP")
        if self.over_udp and not self.free_ports:
            host, port = scenario.links.host, self.hub_port
            check_ports(scenario, None if port is None else UdpAddress(host, port))

    def remarks(self, scenario: Scenario) -> Iterator[str]:
        """Yield the remarks on flying a scenario so."""
        if (size := trajectory_bytes(scenario, self.record)) > _LARGE:
            yield f"recording the trajectory needs up to {size / 1e6:.0f} MB"
        uavs, cores = len(scenario.uavs), os.cpu_count() or 1
        if self.can_share and self.autopilot_processes is None and uavs >= _MANY * cores:
            name = self.named("autopilot_processes")
            yield f"{uavs} autopilots share {cores} cores: they fly faster with {name} {cores}"
        if not self.over_udp and scenario.fence is not None and scenario.fence.enable:
            yield WarningRemark(
                f"{WARNING}nobody watches the fence of a flight in process: fly it over UDP"
            )
        if self.over_udp:
            links = scenario.links
            yield from exposures(links, with_key=links.signing_key is not None)
            yield from map(WarningRemark, to_start(scenario))


IN_PROCESS = How(over_udp=False)


@dataclass(frozen=True)
class Prepared:
    """A flight that can begin.

    Attributes:
        scenario: What is flown, with all changes.
        how: How it is flown.
        mark: What its run folder is marked with.
        remarks: What the user should know; a `WarningRemark` warns.
    """

    scenario: Scenario
    how: How
    mark: FlightMark
    remarks: tuple[str, ...]


def prepare(
    scenario: ScenarioLike,
    how: How = IN_PROCESS,
    *,
    additions: Sequence[Path | str] = (),
    values: Mapping[str, Any] | None = None,
    signing_key: Path | str | None = None,
    command: str = "fly",
    name: str = "",
) -> Prepared:
    """Prepare a flight.

    Args:
        scenario: A scenario, a file, or the name of a bundled one.
        how: How it is flown.
        additions: As of `with_changes`.
        values: As of `with_changes`.
        signing_key: Key file in place of the scenario's.
        command: The command of `gcs` that flies so.
        name: What the user calls the scenario, if it was read.

    Raises:
        BadInput: The scenario, a change or an option cannot be used, or a port is in use.
        ConfigError: A file cannot be used, or the result is no valid scenario.
        PluginError: A plug-in cannot be used.
    """
    changed = with_changes(scenario, additions, values or {}, how.named("changes"))
    flown = signed(changed, signing_key)
    how.check(flown)
    remarks = checked(flown)
    named = name or (scenario.name if isinstance(scenario, Scenario) else str(scenario))
    mark = FlightMark.of(command, named, flown, [*map(str, additions)], plain(values or {}))
    return Prepared(flown, how, mark, (*remarks, *how.remarks(flown)))


@contextlib.contextmanager
def begun(prepared: Prepared, folder: Path) -> Iterator[None]:
    """Mark the run folder of a flight while the context lasts.

    Raises:
        BadInput: The flight does not fit on the disk.
        OSError: A file cannot be written; it is named.
    """
    scenario, how = prepared.scenario, prepared.how
    if how.hub_port is None:
        check_space(folder, scenario, how.record, over_udp=how.over_udp, restart=how.restart)
    with marked(folder, scenario, prepared.mark):
        yield


def checked(scenario: Scenario) -> list[str]:
    """Load what a scenario is flown with that is not ours; return the remarks on it.

    Raises:
        BadInput: A simulator or a plug-in cannot fly it.
        PluginError: A plug-in cannot be used.
    """
    check_simulators(scenario)
    return [*prepare_plugins(scenario), *remarks_of(scenario)]


def check_simulators(scenario: Scenario) -> None:
    """Load what flies the aircraft in place of the plant's own equations, if anything does.

    Raises:
        BadInput: It cannot fly one of them.
    """
    plant = scenario.plant_config()
    flown = [uav for uav in plant.uavs if not isinstance(uav.plant, OwnPlant)]
    if not flown:
        return
    from sitl_plant.loop.simulators import simulator_of
    from sitl_plant.simulators.base import SimulatorError

    try:
        for uav in flown:
            simulator_of(uav, plant.step_us)
    except SimulatorError as problem:
        raise BadInput(str(problem), problem.hint) from problem
