"""The plant's side of the simulator link: the compiled loop between datagrams and physics.

`run` advances simulated time while it can, and returns to Python only for a datagram that is not
hot, when the deadline passes, or when the flight is over. Python code (`sitl_plant.process`)
never runs while a step is half done, but to advance the simulators that fly aircraft in place of
the plant's own equations (`sitl_plant.outside`).

By true states an autopilot is sent one FTC_SIM_STATE in each step; by sensors a HIL_SENSOR of each
IMU, HIL_GPS if there is a sample, and FTC_SIM_STEP last.

Lockstep: a step is ready when each autopilot has answered the state with FTC_STEP_DONE; a
state without an answer is sent again. Real time: a step is ready when its period has passed by
the wall clock; the aircraft fly the commands received last.
"""

from typing import NamedTuple

import numpy as np

from mavlink_defs.constants import N_CHANNELS, SIMULATOR_COMPONENT
from mavlink_defs.dialect import (
    FTC_SIM_FLAGS_GPS,
    FTC_SIM_FLAGS_LOCKSTEP,
    FTC_SIM_FLAGS_RUNNING,
)
from mavlink_defs.framing import codec
from mavlink_defs.framing.drop_reason import DropReason
from mavlink_defs.framing.hot_link import DROPPED, NOT_HOT, Outcome, take
from mavlink_defs.framing.hot_signing import LinkSigner, new_link_signer, sign_frame
from mavlink_defs.framing.signing import PLANT_LINK
from mavlink_defs.runtime import native
from mavlink_defs.runtime.jit import compiled, inlined
from mavlink_defs.runtime.memory import borrowed, copy_values
from sitl_plant.fleet import (
    ADVANCE,
    PlantState,
    fly,
    navigates,
    observe,
    receive_controls,
)

_RESEND_S = 0.05
_MAX_LAG_S = 0.1

LINK_STATE = np.dtype(
    [
        ("step", "i8"),
        ("step_us", "i8"),
        ("last_step", "i8"),
        ("speed", "f8"),  # real-time factor, 0: lockstep
        ("flags", "i8"),  # FTC_SIM_FLAGS
        ("waiting", "i8"),  # 1: the states of `step` are sent
        ("sent_s", "f8"),  # when [s]
        ("origin_s", "f8"),  # wall-clock time that `origin_step` belongs to [s]
        ("origin_step", "i8"),
        ("lag_s", "f8"),  # wall-clock time given up because the machine was too slow [s]
        ("received", "i8"),  # length of the datagram in `received`
        ("lost", "i8"),  # index of a lost aircraft
        ("recorded", "i8"),  # rows of the record in use
    ]
)


class Record(NamedTuple):
    """Room for the record of some steps, none if nothing is recorded; Python empties it."""

    states: np.ndarray  # (rows, n, 12)
    wind: np.ndarray  # (rows, n, 3)
    applied: np.ndarray  # (rows, n, 4)


class PlantLink(NamedTuple):
    """Peers, time and buffers of a plant of n aircraft."""

    state: np.ndarray  # (1,), dtype LINK_STATE
    systems: np.ndarray  # (n,), system id of each aircraft
    known: np.ndarray  # (n,), 1: an autopilot is registered
    addresses: np.ndarray  # (n, native.ADDRESS_SIZE), sockaddr of the autopilot
    heard_s: np.ndarray  # (n,), wall-clock time of its last datagram [s]
    done: np.ndarray  # (n,), last step that it has finished
    silent: np.ndarray  # (32,), FTC_SIM_STATE.silent of the next step
    sequences: np.ndarray  # (n,), frames sent by each simulator component
    drops: np.ndarray  # (DROPS_SIZE,), datagrams dropped, by negated `DropReason`
    sent: np.ndarray  # datagram buffer
    received: np.ndarray  # datagram buffer
    sender: np.ndarray  # (native.ADDRESS_SIZE,), where it came from
    step_done: np.ndarray  # views of `received`
    actuators: np.ndarray
    record: Record
    signer: LinkSigner


def new_link(
    systems: list[int],
    step_us: int,
    last_step: int,
    speed: float | None,
    record_rows: int,
    link_signer: LinkSigner | None = None,
) -> PlantLink:
    """Return the link of a plant with which no autopilot has registered.

    Args:
        systems: System id of each aircraft.
        step_us: Control period [µs].
        last_step: Step at which the simulation ends.
        speed: Real-time factor; None for lockstep.
        record_rows: Steps whose record there is room for; 0 to record nothing.
        link_signer: Signs the link.
    """
    n = len(systems)
    state = np.zeros(1, LINK_STATE)
    state["step_us"] = step_us
    state["last_step"] = last_step
    state["speed"] = speed or 0.0
    state["flags"] = 0 if speed else FTC_SIM_FLAGS_LOCKSTEP
    state["lost"] = -1
    received = codec.new_buffer()
    return PlantLink(
        state=state,
        systems=np.array(systems),
        known=np.zeros(n, np.int64),
        addresses=np.zeros((n, native.ADDRESS_SIZE), np.uint8),
        heard_s=np.zeros(n),
        done=np.full(n, -1),
        silent=np.zeros(codec.SIM_STATE["silent"].shape, np.uint8),
        sequences=np.zeros(n, np.int64),
        drops=np.zeros(codec.DROPS_SIZE, np.int64),
        sent=codec.new_buffer(),
        received=received,
        sender=np.zeros(native.ADDRESS_SIZE, np.uint8),
        step_done=codec.payload_view(received, codec.STEP_DONE),
        actuators=codec.payload_view(received, codec.ACTUATORS),
        record=Record(
            states=np.zeros((record_rows, n, 12)),
            wind=np.zeros((record_rows, n, 3)),
            applied=np.zeros((record_rows, n, N_CHANNELS)),
        ),
        signer=link_signer or new_link_signer(b"", PLANT_LINK),
    )


@compiled
def send_states(fd: int, link: PlantLink, fleet: PlantState, unfinished_only: bool) -> None:
    """Send the present state to every registered autopilot, or to those that have not answered.

    Args:
        fd: The plant's socket.
        link: The link.
        fleet: The fleet.
        unfinished_only: Leave out those that have finished the present step.
    """
    state = link.state[0]
    for i in range(len(link.systems)):
        if not unfinished_only:
            observe(fleet, i, state["step"], state["step_us"])
            for k in range(len(link.silent)):
                fleet.messages[i]["silent"][k] = link.silent[k]
        if link.known[i] == 0 or (unfinished_only and link.done[i] >= state["step"]):
            continue
        fleet.messages[i]["flags"] = state["flags"]
        if navigates(fleet):
            _send_sensors(fd, link, fleet, i)
        else:
            _send(fd, link, i, fleet.messages[i : i + 1], codec.MessageId.SIM_STATE)
    if not unfinished_only:
        link.silent[:] = 0
    state["sent_s"] = native.monotonic_s()


@compiled
def _send_sensors(fd: int, link: PlantLink, fleet: PlantState, i: int) -> None:
    """Send what the sensors of an aircraft report in the present step, and the step last."""
    sensing = fleet.sensing
    codec.copy_step(fleet.messages[i], fleet.steps[i])
    for k in range(sensing.imus.shape[1]):
        _send(fd, link, i, sensing.imus[i][k : k + 1], codec.MessageId.SENSOR)
    if sensing.sites[i]["delivered"] == 1:
        fleet.steps[i]["flags"] |= FTC_SIM_FLAGS_GPS
        _send(fd, link, i, sensing.gps[i : i + 1], codec.MessageId.GPS)
    _send(fd, link, i, fleet.steps[i : i + 1], codec.MessageId.SIM_STEP)


@inlined
def _send(fd: int, link: PlantLink, i: int, payload: np.ndarray, message_id: int) -> None:
    """Send a message to the autopilot of an aircraft."""
    length = codec.pack(
        link.sent,
        payload,
        message_id,
        link.systems[i],
        SIMULATOR_COMPONENT,
        link.sequences[i],
    )
    link.sequences[i] += 1
    length = sign_frame(link.signer, link.sent, length)
    native.send_to(fd, link.sent, length, link.addresses[i])


@compiled
def run(fd: int, link: PlantLink, fleet: PlantState, until_s: float) -> Outcome:
    """Advance simulated time, if it runs, until something needs Python.

    Args:
        fd: The plant's socket; its receive timeout bounds how late `until_s` is noticed.
        link: The link.
        fleet: The fleet.
        until_s: Wall-clock time, as `monotonic_s` gives it, at which to return [s].

    Returns:
        SERVICE, TICK (also when the record is full), OVER, LOST, or ADVANCE: when simulators are
        advanced, the next call goes on with the step.
    """
    link, fleet = borrowed(link), borrowed(fleet)
    state, record = link.state[0], link.record
    while True:
        step, row = state["step"], state["recorded"]
        recording = row < len(record.states)
        if fleet.outside[0]["advanced"] == 0:
            running = state["flags"] & FTC_SIM_FLAGS_RUNNING
            if running and state["waiting"] == 0:
                send_states(fd, link, fleet, False)
                state["waiting"] = 1
            outcome = _wait(fd, link, fleet, until_s)
            if outcome != Outcome.NONE:
                return outcome
            if recording:
                for i in range(len(fleet.states)):
                    copy_values(record.states[row, i], fleet.states[i])
                    copy_values(record.wind[row, i], fleet.air[i])
        lost = fly(fleet, step, state["step_us"])
        if lost == ADVANCE:
            return Outcome.ADVANCE
        if recording:
            for i in range(len(fleet.states)):
                copy_values(record.applied[row, i], fleet.applied[i])
            state["recorded"] = row + 1
        state["step"] = step + 1
        state["waiting"] = 0
        if lost >= 0:
            state["lost"] = lost
            return Outcome.LOST
        if state["step"] >= state["last_step"]:
            return Outcome.OVER
        if recording and state["recorded"] == len(record.states):
            return Outcome.TICK


@inlined
def _wait(fd: int, link: PlantLink, fleet: PlantState, until_s: float) -> Outcome:
    """Receive until the step is ready (NONE), or Python is needed (SERVICE, TICK)."""
    state = link.state[0]
    running = state["flags"] & FTC_SIM_FLAGS_RUNNING
    real_time = running and state["speed"] > 0.0
    while True:
        if real_time:
            due_s = due_time_s(link)
            native.sleep_until(min(due_s, until_s))
            length = native.receive_from_now(fd, link.received, link.sender)
            if length < 0 and native.monotonic_s() >= due_s:
                return Outcome.NONE
        else:
            if running and _all_done(link):
                return Outcome.NONE
            if running:
                length = native.receive_from_soon(fd, link.received, link.sender)
            else:
                length = native.receive_from(fd, link.received, link.sender)
        if length >= 0 and _receive(link, fleet, length) == NOT_HOT:
            state["received"] = length
            return Outcome.SERVICE
        now_s = native.monotonic_s()
        if running and not real_time and now_s - state["sent_s"] > _RESEND_S:
            send_states(fd, link, fleet, True)
        if now_s >= until_s:
            if running and not real_time and _all_done(link):
                return Outcome.NONE
            return Outcome.TICK


@compiled
def due_time_s(link: PlantLink) -> float:
    """Return when the present step ends [s, wall time]; a machine too slow shifts the origin."""
    state = link.state[0]
    periods = state["step"] + 1 - state["origin_step"]
    due_s = state["origin_s"] + periods * state["step_us"] / 1e6 / state["speed"]
    late_s = native.monotonic_s() - due_s
    if late_s > _MAX_LAG_S:
        state["origin_s"] += late_s
        state["lag_s"] += late_s
    value: float = due_s
    return value


@inlined
def _all_done(link: PlantLink) -> bool:
    step = link.state[0]["step"]
    for i in range(len(link.done)):
        if link.done[i] < step:
            return False
    return True


@inlined
def _receive(link: PlantLink, fleet: PlantState, length: int) -> int:
    """Handle a received datagram if it is hot; return the result of `take`."""
    message_id = take(link.signer, link.received, length, link.drops)
    if message_id not in (NOT_HOT, DROPPED):
        problem = _follow(link, fleet, message_id)
        if problem != 0:
            link.drops[-problem] += 1
    return message_id


@inlined
def _follow(link: PlantLink, fleet: PlantState, message_id: int) -> int:
    """Follow a checked hot message; return 0, or the `DropReason` if it is refused."""
    i = _index_of_sender(link)
    if i < 0:
        return DropReason.STRANGER
    link.heard_s[i] = native.monotonic_s()
    if message_id == codec.MessageId.STEP_DONE:
        codec.expand(link.received, codec.STEP_DONE_SIZE)
        step = link.step_done[0]["step"]
        if step > link.state[0]["step"]:
            return DropReason.OUT_OF_RANGE
        if step > link.done[i] and link.step_done[0]["silent"] != 0:
            link.silent[link.systems[i] >> 3] |= 1 << (link.systems[i] & 7)
        link.done[i] = max(link.done[i], step)
        return 0
    if message_id == codec.MessageId.ACTUATORS:
        codec.expand(link.received, codec.ACTUATORS_SIZE)
        return receive_controls(fleet, i, link.actuators[0])
    return DropReason.UNEXPECTED


@inlined
def _index_of_sender(link: PlantLink) -> int:
    """Return the index of the aircraft whose registered autopilot sent the datagram, or -1."""
    system = codec.system_of(link.received)
    for i in range(len(link.systems)):
        if link.systems[i] == system and link.known[i] == 1:
            return i if native.same_address(link.addresses[i], link.sender) else -1
    return -1
