"""What a bad simulator link costs each law in scenario 1, with and without compensation.

    python -m benchmarks.bad_links

Plant, autopilots and the impairments of `links.impairments` in one process. The times of the
impairments are simulated time here: the load of the machine has no influence, and every run gives
the same table.
"""

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from benchmarks.impairer import Impairer
from ftc_autopilot.control.controllers import ReferenceSource
from ftc_autopilot.control.laws import KINDS
from ftc_autopilot.control.reference import profile_record
from ftc_autopilot.control.signals import no_signals
from ftc_autopilot.control.stepping import (
    broadcast_if_triggered,
    controller_step,
    hear,
    publish_own_state,
)
from ftc_autopilot.hot.acknowledgement import note_delay, note_events
from ftc_autopilot.hot.state import new_autopilots
from gcs.results.figures import UavSummary
from gcs.results.quantities import QUANTITIES
from gcs.results.recording import Recording
from gcs.results.summary import summarise
from gcs.scenario.model import Scenario, scenario_of, scenario_tree
from mavlink_defs.capture.impairment import Bursts, Impairment
from mavlink_defs.framing.codec import ACTUATORS, SIM_STATE
from sitl_plant.loop.fault_commands import faults_of
from sitl_plant.loop.fleet import PlantState, fly, new_plant_state, observe, receive_controls

LINKS = {
    "loss 5 %": Impairment(loss=0.05),
    "loss 10 %": Impairment(loss=0.1),
    "loss 20 %": Impairment(loss=0.2),
    "bursts of 10 periods": Impairment(bursts=Bursts(begin=0.005, end=0.1)),
    "delay 5 ms": Impairment(delay_ms=2.5),
    "delay 10 ms": Impairment(delay_ms=5.0),
    "delay 20 ms": Impairment(delay_ms=10.0),
    "jitter 5 ms": Impairment(jitter_ms=5.0),
    "loss 10 %, jitter 5 ms": Impairment(loss=0.1, jitter_ms=5.0),
}
"""Links by name; their delays are those there and back."""


class _Direction:
    """One direction of a link: datagrams that have not arrived."""

    def __init__(self, impairment: Impairment, name: str) -> None:
        self._impairer = Impairer(impairment, name)
        self._under_way: list[tuple[float, bytes]] = []

    def send(self, payload: np.void, now_s: float) -> None:
        self._under_way += self._impairer.send(payload.tobytes(), now_s)

    def arrived(self, until_s: float) -> Iterator[tuple[float, bytes]]:
        while self._under_way and self._under_way[0][0] < until_s:
            yield self._under_way.pop(0)


class _Autopilot:
    """The link and the controller of one UAV."""

    def __init__(self, scenario: Scenario, uav: int, impairment: Impairment) -> None:
        config = scenario.autopilot_config(uav)
        self.neighbours = [neighbour.id for neighbour in config.neighbours]
        autopilots = new_autopilots([config])
        self.controllers = autopilots.controllers
        self.controllers.edges[0]["weight"] = [one.weight for one in config.neighbours]
        self.controllers.uavs[0]["profile"] = profile_record(scenario.segments())
        for key, value in (("active", 1), ("follows", ReferenceSource.PROFILE), ("start_step", 0)):
            self.controllers.uavs[0]["guidance"][key] = value
        self.link = autopilots.own[0]["link"]
        self.states = _Direction(impairment, f"states {uav}")
        self.commands = _Direction(impairment, f"commands {uav}")

    def receive(self, datagram: bytes, at_s: float, compensated: bool) -> int:
        """Handle a state; return its step."""
        measured, controllers = np.frombuffer(datagram, SIM_STATE)[0], self.controllers
        step, step_us = int(measured["step"]), int(self.link["step_us"])
        periods = note_delay(self.link, measured)
        if compensated:
            controllers.uavs[0]["delay"]["periods"] = periods
        else:
            delay = controllers.uavs[0]["delay"]
            delay["step"], delay["n_events"] = step - 1, 0  # no state counts as lost, none as late
        mask = controller_step(*controllers.of(0), measured, step_us)
        broadcast_if_triggered(controllers.uavs[0], step, step_us)
        self.link["step"] = step
        if note_events(self.link, measured, mask, False):
            controllers.uavs[0]["actuators"]["time_usec"] = measured["time_usec"]
            self.commands.send(controllers.uavs[0]["actuators"], at_s)
        return step


def fly_over(scenario: Scenario, impairment: Impairment, compensated: bool = True) -> Recording:
    """Fly a scenario with an impaired simulator link, in real time of its own.

    Args:
        scenario: The scenario.
        impairment: Of each datagram; times are simulated ones.
        compensated: Whether delays and lost states are compensated.
    """
    fleet, ids, dt = _fleet_of(scenario), [uav.id for uav in scenario.uavs], scenario.step_us / 1e6
    autopilots = {uav: _Autopilot(scenario, uav, impairment) for uav in ids}
    shape = scenario.steps, len(ids)
    states, wind = np.zeros((*shape, 12)), np.zeros((*shape, 3))
    applied, signals = np.zeros((*shape, 4)), no_signals(scenario.steps * len(ids)).reshape(shape)
    for i, autopilot in enumerate(autopilots.values()):
        observe(fleet, i, 0, scenario.step_us)
        publish_own_state(autopilot.controllers.uavs[0], fleet.uavs[i]["message"])
    _exchange(autopilots)
    for step in range(scenario.steps):
        states[step], wind[step] = fleet.uavs["state"], fleet.uavs["air"][:, :3]
        end_s = (step + 1) * dt
        for i, autopilot in enumerate(autopilots.values()):
            observe(fleet, i, step, scenario.step_us)
            autopilot.states.send(fleet.uavs[i]["message"], step * dt)
            for at_s, datagram in autopilot.states.arrived(end_s):
                worked_on = autopilot.receive(datagram, at_s, compensated)
                signals[worked_on, i] = autopilot.controllers.uavs[0]["signals"]
        _exchange(autopilots)
        for i, autopilot in enumerate(autopilots.values()):
            for _, datagram in autopilot.commands.arrived(end_s):
                receive_controls(fleet, i, np.frombuffer(datagram, ACTUATORS)[0])
        assert fly(fleet, step, scenario.step_us) < 0, "the flight was lost"
        applied[step] = fleet.uavs["applied"]
    repeats = np.array([autopilot.link["repeated"] for autopilot in autopilots.values()])
    return Recording(
        "real_time",
        scenario.step_us,
        tuple(ids),
        states,
        wind,
        applied,
        signals,
        repeats,
        0.0,
        None,
    )


def _fleet_of(scenario: Scenario) -> PlantState:
    fleet, ids = new_plant_state(scenario.plant_config(speed=None)), [u.id for u in scenario.uavs]
    for uav, fault in scenario.fault_commands():
        limits = scenario.aircraft_of(uav).fault_limits
        faults_of(fleet, ids.index(uav), limits).set(fault.family, fault.params, 0.0)
    return fleet


def _exchange(autopilots: dict[int, _Autopilot]) -> None:
    """Deliver the last broadcast of every autopilot to its neighbours."""
    for autopilot in autopilots.values():
        for d, uav in enumerate(autopilot.neighbours):
            own, edges, _ = autopilot.controllers.of(0)
            hear(own, edges, d, autopilots[uav].controllers.uavs[0]["last_broadcast"])


def scenario_with(law: str, duration_s: float) -> Scenario:
    """Return the paper's scenario 1 with another law."""
    tree = scenario_tree(Path("paper/scenario1"))
    if law != "proposed":
        tree["controller"] = {"kind": law}
    return scenario_of("bad links", tree | {"duration_s": duration_s})


def iae(uavs: tuple[UavSummary, ...]) -> dict[str, float]:
    """Return the mean IAE of the UAVs, by quantity."""
    return {name: float(np.mean([uav.iae[name] for uav in uavs])) for name in QUANTITIES}


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.bad_links", description=__doc__)
    parser.add_argument("--laws", nargs="+", choices=KINDS, default=list(KINDS))
    parser.add_argument("--seconds", type=float, default=24.0, help="simulated time")
    options = parser.parse_args()
    rows: dict[str, list[str]] = {name: [] for name in LINKS}
    for law in options.laws:
        scenario = scenario_with(law, options.seconds)
        clean = iae(summarise(fly_over(scenario, Impairment()), scenario).uavs)
        for name, link in LINKS.items():
            growth = []
            for compensated in (False, True):
                found = iae(summarise(fly_over(scenario, link, compensated), scenario).uavs)
                growth.append(max(100.0 * (found[q] / clean[q] - 1.0) for q in QUANTITIES))
            rows[name].append(f"{growth[0]:.1f} / {growth[1]:.1f}")
            print(law, name, rows[name][-1], file=sys.stderr, flush=True)
    print(
        "Largest growth of the IAE of airspeed, roll, pitch, yaw [%], without / with compensation\n"
    )
    print(f"| | {' | '.join(options.laws)} |\n| --- |{' ---: |' * len(options.laws)}")
    for name, cells in rows.items():
        print(f"| {name} | {' | '.join(cells)} |")


if __name__ == "__main__":
    main()
