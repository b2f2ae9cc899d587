"""One autopilot's link between a plant and a neighbour that the test plays."""

import math
import socket
import time
from typing import Any

import numpy as np

from ftc_autopilot.control.controllers import ReferenceSource
from ftc_autopilot.control.reference import profile_record
from ftc_autopilot.hot.loop import new_loops, run
from ftc_autopilot.hot.state import Autopilots, new_autopilots
from gcs.scenario.model import Scenario
from mavlink_defs.dialect import FTC_SIM_FLAGS_LOCKSTEP, FTC_SIM_FLAGS_RUNNING
from mavlink_defs.endpoint import set_receive_timeout
from mavlink_defs.framing import codec
from mavlink_defs.framing.hot_link import ReturnReason

UAV, NEIGHBOUR = 2, 1  # follower 1 has one neighbour, the leader
LOCKSTEP = FTC_SIM_FLAGS_RUNNING | FTC_SIM_FLAGS_LOCKSTEP
NOTHING_APPLIED = 2**64 - 1
TIMEOUT_STEPS = 250


class Rig:
    """The link, over real loopback sockets."""

    def __init__(self, scenario: Scenario) -> None:
        self.plant, self.neighbour, self.own, self.formation, self.gcs = (
            socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(5)
        )
        for sock in (self.plant, self.neighbour, self.own, self.formation, self.gcs):
            sock.bind(("127.0.0.1", 0))
        self.own.connect(self.plant.getsockname())
        set_receive_timeout(self.formation, 0.005)
        self.plant.setblocking(False)
        self.neighbour.setblocking(False)
        address = "{}:{}".format(*self.neighbour.getsockname())
        config = scenario.autopilot_config(UAV)
        others = tuple(n.model_copy(update={"address": address}) for n in config.neighbours)
        timeout = {"neighbours": others, "neighbour_timeout_s": TIMEOUT_STEPS / 1000}
        self.config = config.model_copy(update=timeout)
        self.scenario = scenario
        self.fly_by(new_autopilots([self.config]))

    def fly_by(self, autopilots: Autopilots) -> None:
        """Let the autopilot be this one, before its first step."""
        self.autopilots, self.controllers = autopilots, autopilots.controllers
        self.together = autopilots
        self.controllers.uavs[0]["profile"] = profile_record(self.scenario.segments())
        for key, value in (("active", 1), ("follows", ReferenceSource.PROFILE), ("start_step", 0)):
            self.controllers.uavs[0]["guidance"][key] = value

    def close(self) -> None:
        for sock in (self.plant, self.neighbour, self.own, self.formation, self.gcs):
            sock.close()

    def state(self, *arguments: Any, **named: Any) -> ReturnReason:
        """Send a state as `send_state` does, and let the autopilot answer it."""
        self.send_state(*arguments, **named)
        return self.run()

    def send_state(
        self,
        step: int,
        flags: int = LOCKSTEP,
        applied_usec: int | None = None,
        run: int = 7,
        silent: tuple[int, ...] = (),
    ) -> None:
        """Send a state; by default the plant has applied all that it was sent."""
        flown = self.controllers.uavs[0]["controller"]["steps"] > 0
        sent = int(self.controllers.uavs[0]["actuators"]["time_usec"]) if flown else -1
        state = np.zeros(1, codec.SIM_STATE)
        state["step"], state["time_usec"], state["flags"] = step, step * 1000, flags
        state["run"] = run
        for system in silent:
            state["silent"][0, system // 8] |= 1 << system % 8
        state["velocity"], state["attitude"] = (40.0, 0.0, 0.5), (0.0, math.radians(1.0), 0.0)
        applied = sent if applied_usec is None else applied_usec
        state["actuator_time_usec"] = NOTHING_APPLIED if applied < 0 else applied
        datagram = codec.new_buffer()
        length = codec.pack(datagram, state, codec.MessageId.SIM_STATE, UAV, 25, step)
        self.plant.sendto(datagram[:length].tobytes(), self.own.getsockname())

    def run(self, until_s: float | None = None) -> ReturnReason:
        fds = self.own.fileno(), self.formation.fileno(), self.gcs.fileno()
        until_s = time.monotonic() if until_s is None else until_s
        loops = new_loops(self.autopilots, [fds])
        loops.state["until_s"], loops.state["until_step"] = until_s, 2**62
        run(loops)
        return ReturnReason(loops.state[0]["outcome"])

    def no_more_events(self) -> None:
        thresholds = self.controllers.uavs["parameters"]["trigger"]
        thresholds["a2_n"] = thresholds["b2_rad"] = 1e9

    def send_neighbour_state(
        self,
        step: int,
        airspeed: float = 41.0,
        system: int = NEIGHBOUR,
        sock: socket.socket | None = None,
        frame: int = 0,
    ) -> None:
        payload = np.zeros(1, codec.NEIGHBOUR)
        payload["step"], payload["airspeed"], payload["frame"] = step, airspeed, frame
        datagram = codec.new_buffer()
        length = codec.pack(datagram, payload, codec.MessageId.NEIGHBOUR, system, 1, step)
        sock = sock or self.neighbour
        sock.sendto(datagram[:length].tobytes(), self.formation.getsockname())

    def heard(self, sock: socket.socket) -> list[int]:
        """Return the ids of the hot messages that have arrived."""
        ids: list[int] = []
        datagram = codec.new_buffer()
        while True:
            try:
                length = sock.recv_into(datagram.data)
            except BlockingIOError:
                return ids
            ids.append(codec.check(datagram, length))
