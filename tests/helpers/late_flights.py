"""Flights of one UAV in real time of their own, whose states and commands come when a test says."""

import random
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from benchmarks import bad_links
from ftc_autopilot.control.laws import own_state
from ftc_autopilot.control.stepping import publish_own_state
from gcs.scenario.model import Scenario, scenario_of, scenario_tree
from mavlink_defs.capture.impairment import Impairment
from mavlink_defs.config.inherit import merged
from mavlink_defs.constants import ACTUATORS
from mavlink_defs.framing.codec import ACTUATORS as CONTROLS
from mavlink_defs.framing.codec import SIM_STATE
from sitl_plant.loop.fleet import fly, observe, receive_controls

When = Callable[[float], float]
"""When what is sent at a time arrives [s]."""


def at_once(t: float) -> float:
    return t


def stopped(begin_s: float, seconds: float) -> When:
    """A process that stands still: what it was sent meanwhile arrives at the end."""
    return lambda t: begin_s + seconds if begin_s <= t < begin_s + seconds else t


def now_and_then(begin_s: float, seconds: float, apart_s: tuple[float, float], seed: int) -> When:
    """A process that gets the processor now and then only, for a time; and the plant catches up."""
    turns, draw = [begin_s], random.Random(seed)
    while turns[-1] < begin_s + seconds:
        turns.append(turns[-1] + draw.uniform(*apart_s))
    return lambda t: next((at for at in turns if at > t), t) if t >= begin_s else t


def late(begin_s: float, seconds: float, most_s: float, seed: int) -> When:
    """Each datagram comes later than it was sent, for a time, up to `most_s`."""

    def arrives(t: float) -> float:
        if not begin_s <= t < begin_s + seconds:
            return t
        return t + random.Random(f"{seed} {t:.4f}").uniform(0.0, most_s)

    return arrives


class _Line(bad_links._Direction):
    """Datagrams on their way, each with the time at which it arrives."""

    def __init__(self, when: When) -> None:
        super().__init__(Impairment(), "")
        self._when = when

    def send(self, payload: np.void, now_s: float) -> None:
        self._under_way.append((self._when(now_s), payload.tobytes()))

    def arrived(self, until_s: float) -> Iterator[tuple[float, bytes]]:
        there = sorted(one for one in self._under_way if one[0] < until_s)
        self._under_way = [one for one in self._under_way if one[0] >= until_s]
        return iter(there)


def _step_of(datagram: bytes) -> int:
    return int(np.frombuffer(datagram, SIM_STATE)[0]["step"])


def scenario_of_one(base: str, *additions: str, **changes: Any) -> Scenario:
    """Return a bundled scenario with its first UAV alone, without faults, with keys replaced."""
    tree = scenario_tree(base)
    for addition in additions:
        tree = merged(tree, scenario_tree(addition))
    one = tree["uavs"][0]["id"]
    tree["network"] = {"edges": [], "leader_access": {one: 1.0}}
    return scenario_of(base, tree | {"uavs": tree["uavs"][:1], "faults": []} | changes)


def fly_late(
    scenario: Scenario, states_at: When, commands_at: When = at_once
) -> list[tuple[float, str]]:
    """Fly a scenario of one UAV; return when [s] which actuators were declared lost.

    Args:
        scenario: The scenario.
        states_at: When the state of a time is handled, unless a newer one is there.
        commands_at: When a command of a time reaches the plant.
    """
    fleet, uav, step_us = bad_links._fleet_of(scenario), scenario.uavs[0].id, scenario.step_us
    autopilot, dt = bad_links._Autopilot(scenario, uav, Impairment()), step_us / 1e6
    autopilot.states, autopilot.commands = _Line(states_at), _Line(commands_at)
    law = own_state(
        autopilot.controllers.uavs[0]["controller"],
        type(scenario.controller),
        scenario.controller.kind,
    )
    diagnosis = (law["fallback"] if "fallback" in law.dtype.names else law)["diagnosis"]
    observe(fleet, 0, 0, step_us)
    publish_own_state(autopilot.controllers.uavs[0], fleet.uavs[0]["message"])
    lost: list[tuple[float, str]] = []
    before = np.zeros(len(ACTUATORS), bool)
    for step in range(scenario.steps):
        observe(fleet, 0, step, step_us)
        now_s = step * dt
        autopilot.states.send(fleet.uavs[0]["message"], now_s)
        waiting = [datagram for _, datagram in autopilot.states.arrived(now_s + dt)]
        if waiting:
            newest = max(waiting, key=_step_of)
            if _step_of(newest) > autopilot.link["step"]:
                autopilot.receive(newest, now_s, True)
        now = diagnosis["actuators"]["lost"] != 0
        lost += [(now_s, ACTUATORS[c]) for c in np.flatnonzero(now & ~before)]
        before = now
        for _, datagram in autopilot.commands.arrived(now_s + dt):
            receive_controls(fleet, 0, np.frombuffer(datagram, CONTROLS)[0])
        assert fly(fleet, step, step_us) < 0, "the flight was lost"
    return lost
