"""The compiled loop of a process: it waits for the states of its autopilots and handles them.

Most processes have one autopilot. In lockstep a process may have several, which take turns without
the scheduler.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ftc_autopilot.control.stepping import broadcast_if_triggered, controller_step, has_failed
from ftc_autopilot.hot.checkpoint import save
from ftc_autopilot.hot.link import note_step, prepare_step, report_done, send_step
from ftc_autopilot.hot.navigation import is_unplaced
from ftc_autopilot.hot.receiving import is_due, receive_states
from ftc_autopilot.hot.state import FORMATION_SIGNER, PLANT_SIGNER, Autopilots
from mavlink_defs.dialect import FTC_SIM_FLAGS_LOCKSTEP, FTC_SIM_FLAGS_RUNNING
from mavlink_defs.framing.hot_link import ReturnReason
from mavlink_defs.framing.hot_signing import LinkSigner
from mavlink_defs.runtime.jit import compiled, inlined
from mavlink_defs.runtime.memory import borrowed, bytes_of
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
        ("row", "i4"),  # of the autopilot in `Autopilots`
        ("plant_fd", "i4"),  # socket connected to the plant
        ("formation_fd", "i4"),  # bound to the own formation port, with a short receive timeout
        ("gcs_fd", "i4"),  # of the ground stations
        ("outcome", "i4"),  # why Python is needed, an `ReturnReason`
        ("at_once", "i4"),  # whether a ground station is answered at once
        ("until_step", "i8"),  # step after which it is
        ("until_s", "f8"),  # and the time, as `monotonic_s` gives it [s]
    ]
)


class Loops(NamedTuple):
    """The loop over the autopilots of a process, or over one of them."""

    state: np.ndarray  # (n,), dtype LOOP_STATE
    polled: np.ndarray  # (2n,), dtype POLLED
    autopilots: Autopilots


def new_loops(
    autopilots: Autopilots, fds: Sequence[tuple[int, int, int]], rows: Sequence[int] = (0,)
) -> Loops:
    """Return the loops for `run`.

    Args:
        autopilots: At least one.
        fds: Sockets of each of them that flies: connected to the plant, on its formation port, of
            ground stations.
        rows: Which ones of the autopilots these are.
    """
    state = np.zeros(len(fds), LOOP_STATE)
    state["row"] = rows
    for one, sockets in zip(state, fds, strict=True):
        one["plant_fd"], one["formation_fd"], one["gcs_fd"] = sockets
    return Loops(state, np.zeros(2 * len(fds), POLLED), autopilots)


@compiled
def run(loops: Loops) -> None:
    """Handle states until an autopilot needs Python.

    A datagram of a ground station is a reason, except in real time and before the plant was
    heard, where `until_s` is soon enough.

    Args:
        loops: Of the autopilots. `outcome` is written: NONE, SERVICE, TICK (also when the
            record is full), OVER or RESTARTED; after the last, `reset_links` before the next call.
    """
    state, polled, autopilots = borrowed(loops)
    for i in range(len(state)):
        state[i]["outcome"] = ReturnReason.NONE
    now_s = monotonic_s()
    poll_s, spin_until_s = now_s + _GCS_POLL_S, now_s + SPIN_S
    while True:
        spins, heard = False, False
        polls = now_s >= poll_s
        if polls:
            poll_s = now_s + _GCS_POLL_S
        for i in range(len(state)):
            now, own = state[i], autopilots.own[state[i]["row"]]
            length = receive_now(now["plant_fd"], bytes_of(own["received"]))
            if length >= 0:
                heard = True
                now["outcome"] = _handle(length, now, autopilots)
            now_s = monotonic_s()
            lockstep = _is_lockstep(own["link"])
            spins |= lockstep
            if now["outcome"] == ReturnReason.NONE and (
                now_s >= now["until_s"]
                or own["link"]["step"] >= now["until_step"]
                or 0 < autopilots.record.shape[1] == own["link"]["recorded"]
                or has_failed(own["uav"])
                or (polls and lockstep and waits(now["gcs_fd"], bytes_of(own["received"])))
            ):
                now["outcome"] = ReturnReason.TICK
            now["at_once"] = _answers_at_once(own["link"])
        if _some_need_python(state):
            return
        if heard:
            spin_until_s = now_s + SPIN_S
        elif spins and now_s < spin_until_s:
            let_others_run()
        elif _sleep(state, polled):
            return
        now_s = monotonic_s()


@inlined
def _handle(length: int, now: np.void, autopilots: Autopilots) -> ReturnReason:
    """Handle a datagram of the plant, and make the step if one is due; return why."""
    i = now["row"]
    own, path, history = autopilots.own[i], autopilots.paths[i], autopilots.histories[i]
    edges = autopilots.edges[i][: own["degree"]]
    plant_fd, formation_fd = now["plant_fd"], now["formation_fd"]
    signers, newest = own["signers"], autopilots.newest[i]
    plant = LinkSigner(signers[PLANT_SIGNER], autopilots.shared, newest[PLANT_SIGNER])
    formation = LinkSigner(signers[FORMATION_SIGNER], autopilots.shared, newest[FORMATION_SIGNER])
    outcome = receive_states(length, plant_fd, own, history, plant)
    if not is_due(outcome, plant_fd, own):
        return outcome
    if prepare_step(formation_fd, plant_fd, own, edges, formation):
        uav, measured, step_us = own["uav"], own["measured"], own["link"]["step_us"]
        uav["guidance"]["unplaced"] = is_unplaced(own["navigation"])
        mask = controller_step(uav, edges, path, measured, step_us)
        broadcasts = broadcast_if_triggered(uav, measured["step"], step_us)
        due = note_step(own, autopilots.record[i], autopilots.estimates[i], mask)
        save(autopilots.checkpoint, autopilots.own, autopilots.edges)
        send_step(plant_fd, formation_fd, due, broadcasts, own, edges, plant, formation)
    return ReturnReason.OVER if report_done(plant_fd, own, plant) else outcome


@inlined
def _is_lockstep(link: np.void) -> bool:
    """Return whether simulated time waits for this autopilot."""
    return bool(link["flags"] == FTC_SIM_FLAGS_RUNNING | FTC_SIM_FLAGS_LOCKSTEP)


@inlined
def _some_need_python(state: np.ndarray) -> bool:
    for i in range(len(state)):
        if state[i]["outcome"] != ReturnReason.NONE:
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
            state[i]["outcome"] = ReturnReason.TICK
    return _some_need_python(state)


@inlined
def _answers_at_once(link: np.void) -> bool:
    """Return whether the plant was heard and no control step can be late."""
    both = FTC_SIM_FLAGS_RUNNING | FTC_SIM_FLAGS_LOCKSTEP
    return bool(link["run"] >= 0 and link["flags"] & both != FTC_SIM_FLAGS_RUNNING)
