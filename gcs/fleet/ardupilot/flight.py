"""A flight of a scenario's aircraft by ArduPilot SITLs, one for each UAV, in lockstep with all.

No socket and no clock: datagrams and the time go in, answers and recorded steps come out. Servos,
faults, wind and sensors are the scenario's. Time is the plant's: a frame is answered when the plant
has flown it, and the plant flies when every ArduPilot has sent a frame.
"""

import math
from collections.abc import Callable, Iterator

import numpy as np

from ftc_autopilot.control.signals import no_signals
from gcs.console.errors import BadInput
from gcs.fleet.in_process import add_faults
from gcs.results.recording import Ending, Steps
from gcs.scenario.model import Scenario
from mavlink_defs.constants import N_CHANNELS, THROTTLE
from mavlink_defs.framing.codec import ACTUATORS
from mavlink_defs.runtime.jit import compiled
from mavlink_defs.runtime.memory import copy_values
from sitl_plant.ardupilot.launch import AircraftLaunch, new_launch, out_of_body
from sitl_plant.ardupilot.outputs import Outputs
from sitl_plant.ardupilot.peer import Address, Frame, Peer
from sitl_plant.ardupilot.protocol import Measured, answer, steps_of
from sitl_plant.loop.fleet import (
    ADVANCE,
    PlantState,
    contacts_of,
    fly,
    loss_of,
    new_plant_state,
    observe,
    receive_controls,
)
from sitl_plant.loop.period import time_s
from sitl_plant.loop.simulators import Outside, flown_by
from sitl_plant.simulators.base import SimulatorError
from sitl_plant.vec3 import norm, sub, vec3

_CHUNK_STEPS = 2000
_ALL = (1 << N_CHANNELS) - 1
_NEAR = 0.01  # relative difference of a step from what was asked for that is not worth a word
_SETTLED_S = 2.0  # its first frames come before it has read its parameters [s of its time]


class ArduPilotFlight:
    """The plant and the ArduPilots that fly it.

    Attributes:
        peers: The ArduPilot of each UAV.
        loss: Why the flight was lost; None if it was not.
        step: Control periods flown.
        fleet: The aircraft; another one in each flight that begins again.
        events: Events so far, shape (n, 4), in the order of FTC_ACTUATOR.
        messages: Steps so far with at least one event, shape (n,).
        restarts: How often it began again, because an ArduPilot was started again.
    """

    def __init__(
        self,
        scenario: Scenario,
        on_steps: Callable[[Steps], None],
        notify: Callable[[str], None],
        on_restart: Callable[[], None],
    ) -> None:
        """Wait for the ArduPilots.

        Args:
            scenario: Whose aircraft, servos, faults, wind and sensors are flown.
            on_steps: Called with the recorded steps, in order; their arrays are used again.
            notify: Called with a line for the operator.
            on_restart: Called when the flight begins again, after the last steps of the one before.
        """
        self._scenario, self._on_steps, self._notify = scenario, on_steps, notify
        self._on_restart = on_restart
        self._ids = [uav.id for uav in scenario.uavs]
        n = len(self._ids)
        self.peers = [Peer() for _ in range(n)]
        self.restarts = 0
        self._due = [0] * n  # tick at which each last frame is to be answered
        self._answers = [b""] * n
        self._asked: dict[tuple[int, int], float] = {}  # tick of the first frame, by UAV and rate
        self._steps = Steps.room(_CHUNK_STEPS, n)
        self._steps.signals[:] = no_signals(1)[0]
        self._payloads = np.zeros(n, ACTUATORS)
        self._begin()

    def _begin(self) -> None:
        scenario, n = self._scenario, len(self._ids)
        self.loss: str | None = None
        self.step = 0
        self._tick = 0  # control periods since the first frame: of the hold, the launch, the flight
        self._begins: int | None = None  # tick of the flight's first step
        self._launched: int | None = None  # tick of the launch's first step
        self._rows = 0  # of `_steps`
        plant = scenario.plant_config(speed=None)
        self.fleet = new_plant_state(plant)
        try:
            self._outside = Outside(plant, self.fleet)
        except SimulatorError as problem:
            raise BadInput(str(problem), problem.hint) from problem
        add_faults(scenario, self.fleet)
        for i in range(n):
            observe_at(self.fleet, i, 0, scenario.step_us)
        self._outputs = [Outputs(scenario.ardupilot, one) for one in self.fleet.uavs["aircraft"]]
        self.events = np.zeros((n, N_CHANNELS), np.int64)
        self.messages = np.zeros(n, np.int64)
        self._changed = np.zeros(n, np.uint8)  # actuators whose command is new, a mask of each
        self._launches = self._prepared()

    def _prepared(self) -> list[AircraftLaunch]:
        """Return the launches of all aircraft, which take the same time."""
        fleet, config = self.fleet, self._scenario.ardupilot
        fastest = max(norm(vec3(x[3:6])) for x in fleet.uavs["state"])
        step_us = self._scenario.step_us
        self._launch_steps = math.ceil(fastest / config.launch_acceleration_m_s2 * 1e6 / step_us)
        duration_s = time_s(self._launch_steps, step_us)
        return [
            new_launch(x, air[:3], float(aircraft["g"]), duration_s)
            for x, air, aircraft in zip(
                fleet.uavs["state"], fleet.uavs["air"], fleet.uavs["aircraft"], strict=True
            )
        ]

    @property
    def is_over(self) -> bool:
        """Whether the scenario's end was reached, or the flight was lost."""
        return self.loss is not None or self.step >= self._scenario.steps

    @property
    def is_flying(self) -> bool:
        """Whether the physics has begun: no aircraft is held or on its launch any more."""
        return self._begins is not None and self._tick >= self._begins

    def load_code(self) -> None:
        """Load the compiled code that flies, so that no ArduPilot waits for it."""
        none = self._steps.part(0, 0)
        fly_steps(
            self.fleet,
            self._changed,
            0,
            self._scenario.step_us,
            none.states,
            none.wind,
            none.applied,
            none.signals,
        )
        command(new_plant_state(self._scenario.plant_config(None)), 0, self._payloads[0])

    def waiting_for(self) -> list[int]:
        """Return the indices of the UAVs whose next frame the plant waits for."""
        return [i for i, due in enumerate(self._due) if due <= self._tick]

    def receive(
        self, i: int, datagram: bytes, address: Address, now: float
    ) -> list[tuple[int, bytes, Address]]:
        """Take in a datagram for the i-th aircraft, and fly as far as the frames allow.

        Args:
            i: Index of the UAV.
            datagram: As it came.
            address: Where it came from.
            now: Wall-clock time [s].

        Returns:
            What is to be sent: index of the UAV, answer, address.
        """
        peer = self.peers[i]
        match peer.receive(datagram, address, now):
            case Frame.DROPPED:
                return []
            case Frame.REPEATED:
                answered = self._due[i] <= self._tick
                return [(i, self._answers[i], address)] if answered else []
            case Frame.RESTARTED:
                self._begin_again(i)
            case Frame.NEW:
                pass
        self._take(i)
        return list(self._flown())

    def _begin_again(self, i: int) -> None:
        system = self._ids[i]
        self._notify(f"the ArduPilot of UAV {system} was started again: the flight begins again")
        waiting = [due > self._tick for due in self._due]
        self.restarts += 1
        self.keep()
        self._on_restart()
        self._begin()
        for j, waits in enumerate(waiting):
            self._due[j] = 0
            if waits and j != i:
                self._take(j)

    def _take(self, i: int) -> None:
        """Take the last packet of a peer as its next frame."""
        packet = self.peers[i].packet
        assert packet is not None
        steps = self._steps_of(i, packet.rate_hz)
        self._due[i] = self._tick + steps
        self._changed[i] |= self._outputs[i].receive(packet.pulses_us)

    def _steps_of(self, i: int, rate_hz: int) -> int:
        """Return the control periods of a frame, and say so if they are not what it asks for."""
        step_us = self._scenario.step_us
        steps = steps_of(rate_hz, step_us)
        off = abs(steps * step_us * rate_hz / 1e6 - 1.0)
        since = self._asked.setdefault((i, rate_hz), self._tick)
        if off > _NEAR and (self._tick - since) * step_us > _SETTLED_S * 1e6:
            self._asked[i, rate_hz] = math.inf
            self._notify(
                f"the ArduPilot of UAV {self._ids[i]} asks for steps of {1e6 / rate_hz:.0f} us "
                f"(SIM_RATE_HZ {rate_hz}) and gets {steps * step_us} us, whole control periods of "
                f"{step_us} us: its clock follows the plant's, so only its frames are "
                f"{'longer' if steps * step_us * rate_hz > 1e6 else 'shorter'}"
            )
        return steps

    def _flown(self) -> Iterator[tuple[int, bytes, Address]]:
        """Fly as long as every ArduPilot has sent a frame, and yield the answers."""
        while not self.is_over and not self.waiting_for():
            self._advance(min(self._due) - self._tick)
            if self.loss is not None:
                return
            for i, peer in enumerate(self.peers):
                if self._due[i] == self._tick and peer.address is not None:
                    self._answers[i] = answer(self._measured(i))
                    yield i, self._answers[i], peer.address

    def _advance(self, count: int) -> None:
        """Let time pass by some control periods: of the hold, the launch or the flight."""
        if self._begins is None:
            self._release()
        while count > 0 and not self.is_over:
            if self._begins is None:
                passed = count
            elif self._tick < self._begins:
                passed = min(count, self._begins - self._tick)
            else:
                passed = self._fly(count)
            self._tick += passed
            count -= passed

    def _release(self) -> None:
        """Launch the aircraft if every ArduPilot commands thrust; at the first frame they fly."""
        config = self._scenario.ardupilot
        thrust = [outputs.shares[THROTTLE] for outputs in self._outputs]
        if not config.hold:
            self._begins = self._tick
        elif min(thrust) > config.launch_throttle:
            if self._tick == 0:
                self._begins = 0
                self._notify("ArduPilot commands thrust in its first frame: flying at once")
            else:
                self._begins = self._tick + self._launch_steps
                self._notify(
                    f"launched at {time_s(self._tick, self._scenario.step_us):.3f} s of "
                    f"ArduPilot's time; {time_s(self._launch_steps, self._scenario.step_us):.3f} s "
                    "later the flight begins, at 0 s of the scenario"
                )
            self._launched = self._tick
        elif self._tick == 0:
            self._notify(
                "held on the launcher until ArduPilot commands thrust: arm it, and take off"
            )

    def _fly(self, count: int) -> int:
        """Fly at most so many control periods; return how many."""
        scenario, fleet = self._scenario, self.fleet
        if self.step == 0:
            self._changed[:] = _ALL  # the first command of each channel is one
        self.events += self._changed[:, None] >> np.arange(N_CHANNELS, dtype=np.uint8) & 1
        self.messages += self._changed != 0
        for i in np.flatnonzero(self._changed).tolist():
            payload = self._payloads[i]
            payload["time_usec"] = self.step * scenario.step_us
            payload["controls"][:N_CHANNELS] = self._outputs[i].shares
            command(fleet, i, payload)
        if self._rows == _CHUNK_STEPS:
            self.keep()
        first, left = self._rows, min(_CHUNK_STEPS - self._rows, scenario.steps - self.step)
        part = self._steps.part(first, first + min(count, left))
        arrays = part.states, part.wind, part.applied, part.signals

        def from_step(flown: int) -> tuple[int, int]:
            rest = [array[flown:] for array in arrays]
            return fly_steps(fleet, self._changed, self.step + flown, scenario.step_us, *rest)

        flown, lost = flown_by(self._outside, from_step)
        self._rows += flown
        self.step += flown
        self._changed[:] = 0
        if lost >= 0:
            why = self._outside.failures.get(lost) or loss_of(fleet, lost)
            at_s = time_s(self.step, scenario.step_us)
            self.loss = f"UAV {self._ids[lost]} was lost at {at_s:.3f} s: {why}"
        return flown

    def keep(self) -> None:
        """Hand over the recorded steps."""
        part = self._steps.part(0, self._rows)._replace(first=self.step - self._rows)
        self._rows = 0
        if part.length:
            self._on_steps(part)

    def ending(self, wall_s: float) -> Ending:
        """Return what is known of the flight besides its steps; `wall_s` as of `Ending`."""
        repeats = np.zeros((len(self._ids), N_CHANNELS), np.int64)
        contacts = contacts_of(self.fleet)
        return Ending("lockstep", self.step, repeats, wall_s, self.loss, contacts=contacts)

    def _measured(self, i: int) -> Measured:
        """Return what the i-th aircraft measures now."""
        at_s = time_s(self._tick, self._scenario.step_us)
        if not self.is_flying:
            since = -1 if self._launched is None else self._tick - self._launched
            return self._launches[i].at(time_s(since, self._scenario.step_us), at_s)
        fleet = self.fleet
        message, attitude = fleet.uavs[i]["message"], vec3(fleet.uavs[i]["state"][6:9])
        through_air = sub(vec3(message["velocity"]), vec3(message["wind"]))
        return Measured(
            time_s=at_s,
            rates=_floats(message["rates"]),
            specific_force=_floats(message["specific_force"]),
            position=_floats(message["position"]),
            attitude=_floats(message["attitude"]),
            velocity=out_of_body(vec3(message["velocity"]), attitude),
            airspeed=norm(through_air),
            wind=out_of_body(vec3(fleet.uavs[i]["air"][:3]), attitude),
        )


def _floats(values: np.ndarray) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z


@compiled
def observe_at(fleet: PlantState, i: int, step: int, step_us: int) -> None:
    """Write what aircraft i measures, as `observe` does; for callers in Python."""
    observe(fleet, i, step, step_us)


@compiled
def command(fleet: PlantState, i: int, actuators: np.void) -> int:
    """Put a payload of commands in force, as `receive_controls` does; for callers in Python."""
    return receive_controls(fleet, i, actuators)


@compiled
def fly_steps(
    fleet: PlantState,
    changed: np.ndarray,
    first: int,
    step_us: int,
    states: np.ndarray,
    wind: np.ndarray,
    applied: np.ndarray,
    signals: np.ndarray,
) -> tuple[int, int]:
    """Fly the steps from `first` on that there is room for, with the commands in force.

    Args:
        fleet: The fleet, whose measurements of the first step are there; of the last one are, then.
        changed: Mask of the commands of each aircraft that are new at the first step, shape (n,).
        first: Number of the first step.
        step_us: Control period [µs].
        states: Shape (steps, n, 12), written; so are the others.
        wind: Shape (steps, n, 3).
        applied: Shape (steps, n, 4).
        signals: Shape (steps, n), dtype `SIGNALS`: what was measured, events, held commands.

    Returns:
        Steps flown, and the index of the lost aircraft, -1, or `ADVANCE` as of `fly`.
    """
    k, lost = 0, -1
    while k < len(states) and lost < 0:
        if fleet.uavs[0]["outside"]["advanced"] == 0:
            for i in range(len(fleet.uavs["state"])):
                copy_values(states[k, i], fleet.uavs[i]["state"])
                copy_values(wind[k, i], fleet.uavs[i]["air"])
                _note(fleet, i, signals[k, i])
                signals[k, i]["events"] = changed[i] if k == 0 else 0
        lost = fly(fleet, first + k, step_us)
        if lost == ADVANCE:
            break
        for i in range(len(fleet.uavs["state"])):
            copy_values(applied[k, i], fleet.uavs[i]["applied"])
            observe(fleet, i, first + k + 1, step_us)
        k += 1
    return k, lost


@compiled
def _note(fleet: PlantState, i: int, signal: np.void) -> None:
    """Write what aircraft i measures, and what is commanded."""
    message = fleet.uavs[i]["message"]
    signal["V"] = norm(sub(vec3(message["velocity"]), vec3(message["wind"])))
    for axis in range(3):
        signal["attitude"][axis] = message["attitude"][axis]
    for c in range(N_CHANNELS):
        signal["held"][c] = fleet.uavs[i]["controls"][c]
