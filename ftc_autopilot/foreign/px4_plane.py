"""A PX4 SITL by its own lockstep, as one of the fleet.

Its sensors are made here, of the true state that the plant sends, by the scenario's
`sensors.navigation`: with the plant's time standing still it has to see an aircraft on a launcher.
"""

import math
import os
import time

import numpy as np

from ftc_autopilot.config import AutopilotConfig
from ftc_autopilot.foreign.base import Conversation, ForeignError, ForeignInputError, PlantStep
from ftc_autopilot.foreign.child import Child
from ftc_autopilot.foreign.px4_connection import Px4Connection
from ftc_autopilot.kinds import Px4Autopilot
from mavlink_defs.constants import THROTTLE
from mavlink_defs.endpoint import UdpAddress, free_ports
from mavlink_defs.framing.codec import SIM_STATE
from sitl_plant.airframe.aircraft import aircraft_record
from sitl_plant.foreign.ardupilot.launch import AircraftLaunch, into_body, new_launch
from sitl_plant.foreign.px4.instruments import Instruments
from sitl_plant.foreign.px4.lockstep import PORT, NotInLockstep, Px4Lockstep, Turn
from sitl_plant.foreign.px4.outputs import Px4Actuators
from sitl_plant.foreign.px4.parameters import px4_parameters

_TURN_S = 0.02
_WAIT_S = 0.5  # between two looks whether it runs
_END_S = 1.0  # from the end of its connection to its own
_LATEST_LAUNCH_S = 5.0  # after arming, by its clock: modes that wait for speed give no thrust
_STARTUP = "startup"
_MAVLINK = "px4-rc.mavlink"


class Px4Plane:
    """One PX4 SITL."""

    def __init__(self, config: AutopilotConfig, vehicle_link: UdpAddress) -> None:
        """Listen for it; `begin` starts it.

        Args:
            config: The configuration of its bridge.
            vehicle_link: Where it is to send its MAVLink.

        Raises:
            EndpointError: Its port cannot be used.
        """
        assert isinstance(config.autopilot, Px4Autopilot)
        self._config, self._own, self._link = config, config.autopilot, vehicle_link
        self._instance = config.id - 1  # its system id is one more
        step_us = config.step_us
        self._every = max(round(1e6 / (self._own.rate_hz * step_us)), 1)  # periods of a frame
        aircraft = aircraft_record(config.aircraft)
        self._gravity = float(aircraft["g"])
        self._lockstep = Px4Lockstep(self._every * step_us)
        self._instruments = Instruments(
            config.sensors,
            config.origin,
            config.aircraft.air_density_kg_m3,
            self._gravity,
            config.id,
            config.sensor_seed,
            step_us,
        )
        self.failures = self._instruments.failures
        self._actuators = Px4Actuators(self._own.outputs, aircraft)
        self._connection = Px4Connection(
            self._own.simulator_host, PORT + self._instance, f"PX4 of UAV {config.id}"
        )
        self._child = Child("PX4", config.id)
        self.notices: list[str] = []
        self._launch: AircraftLaunch | None = None
        self._held = np.zeros(1, SIM_STATE)[0]
        self._tick = 0  # control periods that its sensors have seen
        self._armed_us: int | None = None  # by its clock
        self._launched = False
        self._step = -1  # the last one exchanged
        self._frame_due_s = self._heard_s = 0.0

    def begin(self, first: PlantStep) -> None:
        """Start it, and hold the aircraft on its launcher."""
        state = first.state
        if state is None:
            text = "PX4 is sent sensors of its own, of the true state: set navigation: true_state"
            raise ForeignInputError(f"UAV {self._config.id}: {text}")
        environment = {
            "PX4_SIM_MODEL": self._own.model,
            "PX4_SIM_HOSTNAME": self._own.simulator_host,
            "PATH": self._startup_path(),
        }
        for name, value in self._parameters().items():
            environment[f"PX4_PARAM_{name}"] = f"{value:.9g}"
        arguments = ["-d", "-i", str(self._instance), str(self._own.startup)]
        self._child.start(self._own.binary, arguments, environment)
        x = np.concatenate([state[name] for name in ("position", "velocity", "attitude", "rates")])
        per_frame_s = self._every * self._config.step_us / 1e6
        speed, acceleration = np.linalg.norm(state["velocity"]), self._own.launch_acceleration_m_s2
        frames = math.ceil(float(speed) / acceleration / per_frame_s)
        self._launch = new_launch(x, state["wind"], self._gravity, frames * per_frame_s)
        self._step = first.step - 1
        self._frame_due_s = self._heard_s = time.monotonic()

    def _parameters(self) -> dict[str, float]:
        """Return what it starts with: what the aircraft and its sensors say, then the user."""
        derived = px4_parameters(self._config.aircraft, self._config.sensors)
        return {one.name: one.value for one in derived} | self._own.parameters

    def _startup_path(self) -> str:
        """Return a PATH in which it finds the script of its MAVLink links: one, to the bridge.

        PX4's own comes later in it, and would occupy ports that every fleet wants.
        """
        folder = self._child.folder / _STARTUP
        folder.mkdir()
        (own,) = free_ports(1)
        to = f"-t {self._link.host} -o {self._link.port}"
        line = f"mavlink start -x -u {own} -r 4000000 -f {to}\n"
        (folder / _MAVLINK).write_text(line)
        return os.pathsep.join((str(folder), os.environ.get("PATH", os.defpath)))

    def hold(self, talk: Conversation) -> bool:
        """Let its clock run on; return whether its launch is over."""
        end = time.monotonic() + _TURN_S
        self._check(talk.is_ready)
        while talk.release():  # its MAVLink has a thread of its own: it is not in lockstep
            pass
        talk.exchange(self._lockstep.time_us / 1e6)
        while (now := time.monotonic()) < end:
            if self._is_frame_due(now):
                self._begin_launch(talk.is_armed)
                if self._is_launched():
                    return True
                self._send_frame()
            self._receive(min(end, self._frame_due_s) - now if self._freewheels else end - now)
        return False

    @property
    def _freewheels(self) -> bool:
        return self._connection.is_open and self._lockstep.turn is Turn.FREEWHEELING

    def _is_frame_due(self, now: float) -> bool:
        """Return whether it is to be sent a frame: as it starts, at the pace of the wall clock."""
        if not self._connection.is_open:
            self._frame_due_s = now
            return False
        if not self._freewheels:
            return self._lockstep.turn is Turn.SIMULATOR
        frame_s = self._every * self._config.step_us / 1e6
        due = now >= self._frame_due_s
        if due:
            self._frame_due_s = max(self._frame_due_s + frame_s, now)
        return due

    def _send_frame(self) -> None:
        """Send it what it sees on its launcher."""
        self._write_held()
        for k in range(self._every):
            self._sample(self._held)
            if k == 0:
                self._send()

    def _write_held(self) -> None:
        assert self._launch is not None
        since_s = self._tick * self._config.step_us / 1e6 if self._launched else -1.0
        measured, held = self._launch.at(since_s, 0.0), self._held
        held["position"], held["attitude"] = measured.position, measured.attitude
        held["velocity"] = into_body(measured.velocity, measured.attitude)
        held["wind"] = into_body(measured.wind, measured.attitude)
        held["rates"], held["specific_force"] = measured.rates, measured.specific_force

    def _begin_launch(self, armed: bool) -> None:
        """Launch it once it is armed and gives thrust.

        Its sensors begin again: what they show in flight does not depend on how long it was held.
        """
        if self._launched or not armed or self._freewheels:
            self._armed_us = self._armed_us if armed else None
            return
        now_us = self._lockstep.time_us
        self._armed_us = now_us if self._armed_us is None else self._armed_us
        waited = now_us - self._armed_us > _LATEST_LAUNCH_S * 1e6
        if waited or self._actuators.shares[THROTTLE] > self._own.launch_throttle:
            self._launched, self._tick = True, 0
            self._instruments.restart(now_us)

    def _is_launched(self) -> bool:
        if not self._launched or self._launch is None:
            return False
        return self._tick * self._config.step_us / 1e6 >= self._launch.duration_s

    def exchange(self, sent: PlantStep) -> np.ndarray:
        """Send it what its sensors show at a step, and return what it commands then."""
        assert sent.state is not None
        at_s = sent.time_us / 1e6
        for _ in range(self._step, sent.step):  # in real time, steps may be passed over
            is_due = self._tick % self._every == 0
            self._sample(sent.state)
            if is_due:
                self._send()
                self._wait(at_s)
        self._step = sent.step
        return self._actuators.shares

    def _sample(self, motion: np.void) -> None:
        self._instruments.note(self._tick, motion)
        self._tick += 1

    def _send(self) -> None:
        self._heard_s = time.monotonic()
        self._connection.send(self._lockstep.frame(self._instruments), self._own.answers_within_s)

    def _wait(self, at_s: float) -> None:
        """Wait until it has answered; its clock stands still, and so does the plant's."""
        while self._lockstep.turn is Turn.PX4:
            self._receive(_WAIT_S, at_s)
            self._check_silence(at_s)

    def _receive(self, timeout_s: float, at_s: float | None = None) -> None:
        """Take in what it has sent, if something comes in time [s]."""
        try:
            answers = self._lockstep.answers
            data = self._connection.receive(timeout_s)
            self._lockstep.receive(data)
        except (ForeignError, NotInLockstep) as problem:
            self._child.check(at_s, _END_S)
            when = "before the flight" if at_s is None else f"at {at_s:.3f} s"
            raise ForeignError(f"{problem} {when}") from None
        if self._lockstep.answers > answers:
            self._actuators.receive(self._lockstep.controls)

    def _check(self, ready: bool) -> None:
        """Check that it runs, and becomes ready in time."""
        self._child.check()
        passed_s, limit_s = self._lockstep.time_us / 1e6, self._own.ready_within_s
        if not ready and passed_s > limit_s:
            raise ForeignError(f"PX4 is not ready to be armed after {limit_s:g} s of its time")
        if self._connection.is_open and self._lockstep.turn is not Turn.PX4:
            return
        self._check_silence(None)

    def _check_silence(self, at_s: float | None) -> None:
        silent_s, own = time.monotonic() - self._heard_s, self._own
        is_open = self._connection.is_open
        limit_s = own.answers_within_s if is_open else own.connects_within_s
        if silent_s < limit_s:
            return
        self._child.check(at_s)
        when = "before the flight" if at_s is None else f"at {at_s:.3f} s"
        if is_open:
            raise ForeignError(f"PX4 has not answered a frame for {limit_s:g} s {when}")
        text = f"no PX4 has connected for {limit_s:g} s{self._child.last_line()}"
        raise ForeignError(f"{text}; is autopilot.binary a PX4 built for SITL?")

    def close(self) -> None:
        """End it."""
        self._child.close()
        self._connection.close()
