"""The plant's side of the simulator link: the compiled loop between datagrams and physics.

`run` advances simulated time while it can, and returns to Python only for a datagram that is not
hot, when the deadline passes, or when the flight is over. Python code (`sitl_plant.loop.process`)
never runs while a step is half done, but to advance the simulators that fly aircraft in place of
the plant's own equations (`sitl_plant.loop.simulators`).

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
from mavlink_defs.framing.hot_link import DROPPED, NOT_HOT, ReturnReason, take
from mavlink_defs.framing.hot_signing import LinkSigner, new_link_signer, sign_frame
from mavlink_defs.framing.signing import PLANT_LINK
from mavlink_defs.runtime import native
from mavlink_defs.runtime.jit import compiled, inlined
from mavlink_defs.runtime.memory import borrowed, bytes_of, copy_values
from sitl_plant.loop.fleet import (
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
        ("received", "i8"),  # length of `datagram`
        ("lost", "i8"),  # index of a lost aircraft
        ("recorded", "i8"),  # rows of the record in use
        ("silent", "u1", codec.SIM_STATE["silent"].shape),  # FTC_SIM_STATE.silent, next step
        ("drops", "i8", (codec.DROPS_SIZE,)),  # datagrams dropped, by negated `DropReason`
        ("sent", codec.BUFFER),
        ("datagram", codec.BUFFER),  # received, and where it came from
        ("sender", "u1", (native.ADDRESS_SIZE,)),
        ("step_done", codec.STEP_DONE),  # payloads as they were received
        ("actuators", codec.ACTUATORS),
    ]
)

PEER = np.dtype(
    [
        ("system", "i8"),  # system id of the aircraft
        ("known", "i8"),  # 1: an autopilot is registered
        ("address", "u1", (native.ADDRESS_SIZE,)),  # its sockaddr
        ("heard_s", "f8"),  # wall-clock time of its last datagram [s]
        ("done", "i8"),  # last step that it has finished
        ("sequence", "i8"),  # frames sent by the simulator component
    ]
)
"""The autopilot of an aircraft."""


class StepRecord(NamedTuple):
    """Room for the record of some steps, none if nothing is recorded; Python empties it."""

    states: np.ndarray  # (rows, n, 12)
    wind: np.ndarray  # (rows, n, 3)
    applied: np.ndarray  # (rows, n, 4)


class PlantLink(NamedTuple):
    """Peers, time and buffers of a plant of n aircraft."""

    state: np.ndarray  # (1,), dtype LINK_STATE
    peers: np.ndarray  # (n,), dtype PEER
    record: StepRecord
    signer: LinkSigner

    @property
    def drops(self) -> np.ndarray:
        """Datagrams dropped, by negated `DropReason`, shape (DROPS_SIZE,)."""
        drops: np.ndarray = self.state["drops"][0]
        return drops


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
    peers = np.zeros(n, PEER)
    peers["system"], peers["done"] = systems, -1
    return PlantLink(
        state=state,
        peers=peers,
        record=StepRecord(
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
    for i in range(len(link.peers)):
        peer, message = link.peers[i], fleet.uavs[i]["message"]
        if not unfinished_only:
            observe(fleet, i, state["step"], state["step_us"])
            copy_values(message["silent"], state["silent"])
        if peer["known"] == 0 or (unfinished_only and peer["done"] >= state["step"]):
            continue
        message["flags"] = state["flags"]
        if navigates(fleet):
            _send_sensors(fd, link, fleet, i)
        else:
            _send(fd, link, i, bytes_of(message), codec.MessageId.SIM_STATE)
    if not unfinished_only:
        state["silent"][:] = 0
    state["sent_s"] = native.monotonic_s()


@compiled
def _send_sensors(fd: int, link: PlantLink, fleet: PlantState, i: int) -> None:
    """Send what the sensors of an aircraft report in the present step, and the step last."""
    sensing, step = fleet.sensing, fleet.uavs[i]["step"]
    codec.copy_step(fleet.uavs[i]["message"], step)
    for k in range(sensing.imus.shape[1]):
        _send(fd, link, i, bytes_of(sensing.imus[i, k]), codec.MessageId.SENSOR)
    if sensing.sites[i]["delivered"] == 1:
        step["flags"] |= FTC_SIM_FLAGS_GPS
        _send(fd, link, i, bytes_of(sensing.gps[i]), codec.MessageId.GPS)
    _send(fd, link, i, bytes_of(step), codec.MessageId.SIM_STEP)


@inlined
def _send(fd: int, link: PlantLink, i: int, payload: np.ndarray, message_id: int) -> None:
    """Send a message to the autopilot of an aircraft."""
    peer, datagram = link.peers[i], bytes_of(link.state[0]["sent"])
    length = codec.pack_bytes(
        datagram, payload, message_id, peer["system"], SIMULATOR_COMPONENT, peer["sequence"]
    )
    peer["sequence"] += 1
    length = sign_frame(link.signer, datagram, length)
    native.send_to(fd, datagram, length, peer["address"])


@compiled
def run(fd: int, link: PlantLink, fleet: PlantState, until_s: float) -> ReturnReason:
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
        if fleet.uavs[0]["outside"]["advanced"] == 0:
            running = state["flags"] & FTC_SIM_FLAGS_RUNNING
            if running and state["waiting"] == 0:
                send_states(fd, link, fleet, False)
                state["waiting"] = 1
            outcome = _wait(fd, link, fleet, until_s)
            if outcome != ReturnReason.NONE:
                return outcome
            if recording:
                for i in range(len(fleet.uavs)):
                    copy_values(record.states[row, i], fleet.uavs[i]["state"])
                    copy_values(record.wind[row, i], fleet.uavs[i]["air"])
        lost = fly(fleet, step, state["step_us"])
        if lost == ADVANCE:
            return ReturnReason.ADVANCE
        if recording:
            for i in range(len(fleet.uavs)):
                copy_values(record.applied[row, i], fleet.uavs[i]["applied"])
            state["recorded"] = row + 1
        state["step"] = step + 1
        state["waiting"] = 0
        if lost >= 0:
            state["lost"] = lost
            return ReturnReason.LOST
        if state["step"] >= state["last_step"]:
            return ReturnReason.OVER
        if recording and state["recorded"] == len(record.states):
            return ReturnReason.TICK


@inlined
def _wait(fd: int, link: PlantLink, fleet: PlantState, until_s: float) -> ReturnReason:
    """Receive until the step is ready (NONE), or Python is needed (SERVICE, TICK)."""
    state = link.state[0]
    datagram, sender = bytes_of(state["datagram"]), state["sender"]
    running = state["flags"] & FTC_SIM_FLAGS_RUNNING
    real_time = running and state["speed"] > 0.0
    while True:
        if real_time:
            due_s = due_time_s(link)
            native.sleep_until(min(due_s, until_s))
            length = native.receive_from_now(fd, datagram, sender)
            if length < 0 and native.monotonic_s() >= due_s:
                return ReturnReason.NONE
        else:
            if running and _all_done(link):
                return ReturnReason.NONE
            if running:
                length = native.receive_from_soon(fd, datagram, sender)
            else:
                length = native.receive_from(fd, datagram, sender)
        if length >= 0 and _receive(link, fleet, length) == NOT_HOT:
            state["received"] = length
            return ReturnReason.SERVICE
        now_s = native.monotonic_s()
        if running and not real_time and now_s - state["sent_s"] > _RESEND_S:
            send_states(fd, link, fleet, True)
        if now_s >= until_s:
            if running and not real_time and _all_done(link):
                return ReturnReason.NONE
            return ReturnReason.TICK


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
    for i in range(len(link.peers)):
        if link.peers[i]["done"] < step:
            return False
    return True


@inlined
def _receive(link: PlantLink, fleet: PlantState, length: int) -> int:
    """Handle a received datagram if it is hot; return the result of `take`."""
    drops = link.state[0]["drops"]
    message_id = take(link.signer, bytes_of(link.state[0]["datagram"]), length, drops)
    if message_id not in (NOT_HOT, DROPPED):
        problem = _follow(link, fleet, message_id)
        if problem != 0:
            drops[-problem] += 1
    return message_id


@inlined
def _follow(link: PlantLink, fleet: PlantState, message_id: int) -> int:
    """Follow a checked hot message; return 0, or the `DropReason` if it is refused."""
    i = _index_of_sender(link)
    if i < 0:
        return DropReason.STRANGER
    state, peer = link.state[0], link.peers[i]
    datagram = bytes_of(state["datagram"])
    peer["heard_s"] = native.monotonic_s()
    if message_id == codec.MessageId.STEP_DONE:
        done = state["step_done"]
        codec.unpack(datagram, bytes_of(done))
        if done["step"] > state["step"]:
            return DropReason.OUT_OF_RANGE
        if done["step"] > peer["done"] and done["silent"] != 0:
            state["silent"][peer["system"] >> 3] |= 1 << (peer["system"] & 7)
        peer["done"] = max(peer["done"], done["step"])
        return 0
    if message_id == codec.MessageId.ACTUATORS:
        codec.unpack(datagram, bytes_of(state["actuators"]))
        return receive_controls(fleet, i, state["actuators"])
    return DropReason.UNEXPECTED


@inlined
def _index_of_sender(link: PlantLink) -> int:
    """Return the index of the aircraft whose registered autopilot sent the datagram, or -1."""
    system = codec.system_of(bytes_of(link.state[0]["datagram"]))
    for i in range(len(link.peers)):
        peer = link.peers[i]
        if peer["system"] == system and peer["known"] == 1:
            return i if native.same_address(peer["address"], link.state[0]["sender"]) else -1
    return -1
