"""The compiled loop of a process: it waits for the states of its autopilots and handles them.

Most processes have one autopilot. In lockstep a process may have several, which take turns without
the scheduler.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ftc_autopilot.control.controllers import Controllers
from ftc_autopilot.control.stepping import broadcast_if_triggered, controller_step, has_failed
from ftc_autopilot.hot.link import (
    AutopilotLink,
    prepare_step,
    report_done,
    send_step,
)
from ftc_autopilot.hot.receiving import is_due, receive_states
from mavlink_defs.dialect import FTC_SIM_FLAGS_LOCKSTEP, FTC_SIM_FLAGS_RUNNING
from mavlink_defs.framing.hot_link import Outcome
from mavlink_defs.runtime.jit import compiled, inlined
from mavlink_defs.runtime.memory import borrowed, load_tuple, new_table, store_tuple
from mavlink_defs.runtime.native import (
    POLLED,
    READABLE,
    SPIN_S,
    let_others_run,
    monotonic_s,
    receive_now,
    wait_for_any,
    waits,
)

_GCS_POLL_S = 0.002
"""Lockstep: interval at which datagrams of ground stations are polled [s]."""

LOOP_STATE = np.dtype(
    [
        ("plant_fd", "i4"),  # socket connected to the plant
        ("formation_fd", "i4"),  # bound to the own formation port, with a short receive timeout
        ("gcs_fd", "i4"),  # of the ground stations
        ("outcome", "i4"),  # why Python is needed, an `Outcome`
        ("at_once", "i4"),  # whether a ground station is answered at once
        ("until_step", "i8"),  # step after which it is
        ("until_s", "f8"),  # and the time, as `monotonic_s` gives it [s]
    ]
)


class Loop(NamedTuple):
    """What the compiled loop needs of an autopilot."""

    link: AutopilotLink
    controllers: Controllers  # of one UAV


class Loops(NamedTuple):
    """The loops of the autopilots of a process."""

    state: np.ndarray  # (n,), dtype LOOP_STATE
    table: np.ndarray  # the loops, as of `new_table`
    first: Loop  # the first of them, of the type of all
    polled: np.ndarray  # (2n,), dtype POLLED


def new_loops(loops: Sequence[Loop], fds: Sequence[tuple[int, int, int]]) -> Loops:
    """Return the loops for `run`; the caller keeps their arrays alive.

    Args:
        loops: At least one.
        fds: Sockets of each: connected to the plant, on its formation port, of ground stations.
    """
    state = np.zeros(len(loops), LOOP_STATE)
    for name, column in zip(LOOP_STATE.names or (), zip(*fds, strict=True), strict=False):
        state[name] = column
    table = new_table(len(loops), loops[0])
    for i, loop in enumerate(loops):
        store_tuple(table, i, loop)
    return Loops(state, table, loops[0], np.zeros(2 * len(loops), POLLED))


@compiled
def run(loops: Loops) -> None:
    """Handle states until an autopilot needs Python.

    A datagram of a ground station is a reason, except in real time and before the plant was
    heard, where `until_s` is soon enough.

    Args:
        loops: Of the autopilots. `outcome` is written: NONE, SERVICE, TICK (also when the
            record is full), OVER or RESTARTED; after the last, `reset_link` before the next call.
    """
    loops = borrowed(loops)
    state = loops.state
    for i in range(len(state)):
        state[i]["outcome"] = Outcome.NONE
    now_s = monotonic_s()
    poll_s, spin_until_s = now_s + _GCS_POLL_S, now_s + SPIN_S
    while True:
        spins, heard = False, False
        polls = now_s >= poll_s
        if polls:
            poll_s = now_s + _GCS_POLL_S
        for i in range(len(state)):
            loop = load_tuple(loops.table, i, loops.first)
            link, now = loop.link, state[i]
            plant_fd, formation_fd = now["plant_fd"], now["formation_fd"]
            length = receive_now(plant_fd, link.simulator.received)
            if length >= 0:
                heard = True
                outcome = receive_states(length, plant_fd, link)
                if is_due(outcome, plant_fd, link):
                    if prepare_step(formation_fd, plant_fd, link, loop.controllers):
                        measured, step_us = link.simulator.measured[0], link.state[0]["step_us"]
                        mask = controller_step(loop.controllers, 0, measured, step_us)
                        broadcasts = broadcast_if_triggered(
                            loop.controllers, 0, measured["step"], step_us
                        )
                        send_step(formation_fd, plant_fd, mask, broadcasts, link, loop.controllers)
                    if report_done(plant_fd, link):
                        outcome = Outcome.OVER
                now["outcome"] = outcome
            now_s = monotonic_s()
            lockstep = _is_lockstep(link)
            spins |= lockstep
            if now["outcome"] == Outcome.NONE and (
                now_s >= now["until_s"]
                or link.state[0]["step"] >= now["until_step"]
                or 0 < len(link.record) == link.state[0]["recorded"]
                or has_failed(loop.controllers, 0)
                or (polls and lockstep and waits(now["gcs_fd"], link.simulator.received))
            ):
                now["outcome"] = Outcome.TICK
            now["at_once"] = _answers_at_once(link)
        if _some_need_python(state):
            return
        if heard:
            spin_until_s = now_s + SPIN_S
        elif spins and now_s < spin_until_s:
            let_others_run()
        elif _sleep(state, loops.polled):
            return
        now_s = monotonic_s()


@inlined
def _is_lockstep(link: AutopilotLink) -> bool:
    """Return whether simulated time waits for this autopilot."""
    return bool(link.state[0]["flags"] == FTC_SIM_FLAGS_RUNNING | FTC_SIM_FLAGS_LOCKSTEP)


@inlined
def _some_need_python(state: np.ndarray) -> bool:
    for i in range(len(state)):
        if state[i]["outcome"] != Outcome.NONE:
            return True
    return False


@inlined
def _sleep(state: np.ndarray, polled: np.ndarray) -> bool:
    """Sleep until a datagram comes or a time has come; return whether a ground station waits."""
    until_s = state[0]["until_s"]
    for i in range(len(state)):
        until_s = min(until_s, state[i]["until_s"])
        polled[2 * i]["fd"] = state[i]["plant_fd"]
        polled[2 * i + 1]["fd"] = state[i]["gcs_fd"] if state[i]["at_once"] else -1
    for k in range(len(polled)):
        polled[k]["events"] = READABLE
    wait_for_any(polled, max(until_s - monotonic_s(), 0.0))
    for i in range(len(state)):
        if polled[2 * i + 1]["found"] != 0 and polled[2 * i]["found"] == 0:
            state[i]["outcome"] = Outcome.TICK
    return _some_need_python(state)


@inlined
def _answers_at_once(link: AutopilotLink) -> bool:
    """Return whether the plant was heard and no control step can be late."""
    state = link.state[0]
    both = FTC_SIM_FLAGS_RUNNING | FTC_SIM_FLAGS_LOCKSTEP
    return bool(state["run"] >= 0 and state["flags"] & both != FTC_SIM_FLAGS_RUNNING)
