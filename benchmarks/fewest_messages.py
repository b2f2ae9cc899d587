"""How few messages follower 2 needs in scenario 1 if the sender knows the future.

    python -m benchmarks.fewest_messages --out runs/fewest

The sender knows the aircraft, the disturbances, the fault and the commands to come, and chooses
when which actuator gets which constant command; there is no feedback. Looked for is the schedule
with the fewest transmissions of single channels whose IAEs are all within the paper's (Table IV).
Times and values are optimised together, messages inserted where errors are largest, then taken
out, many at once and at last one by one, as long as the rest compensates for it. The true plant
flies the result.

**What it is: a schedule that exists, so an upper estimate of the minimum.** The search is local:
a schedule with fewer messages may exist, so this is no lower bound. Certain is only that each of
the four channels needs one message, its first.
"""

import argparse
import copy
import itertools
import json
import time
from collections.abc import Callable, Collection
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ftc_autopilot.control.reference import profile_record, profile_value
from ftc_lab.reports.published_values import TABLE_IV
from gcs.fleet.in_process import fly_in_process
from gcs.reports.figures.style import SMALL, draw_curve, new_figure, save, style, tidy
from gcs.results.quantities import PAPER_ORDER, QUANTITIES, UNITS, in_degrees
from gcs.scenario.model import Scenario, load_scenario
from mavlink_defs.config.output_files import write_text
from mavlink_defs.constants import ACTUATORS, N_CHANNELS, THROTTLE
from mavlink_defs.runtime.jit import compiled
from sitl_plant.loop.fault_commands import faults_of
from sitl_plant.loop.fleet import PlantState, fly, new_plant_state

_FOLLOWER_2 = 3
_COARSE_US = 10_000
_CHANNEL_OF = {"airspeed": "throttle", "roll": "aileron", "pitch": "elevator", "yaw": "rudder"}
BUDGET = np.array([TABLE_IV["scenario2_proposed"][quantity] for quantity in QUANTITIES])
"""IAEs of the paper's law [m, deg s], by quantity."""
_SAMPLES = 480
_SOFT = 0.05  # m/s or deg, below which an error counts as a square
_STEP = 1e-4  # of a derivative: share of a limit, or ms
_TRIALS = 14
_MAX_MESSAGES = 200
_MARGIN = 0.995  # of the budget, for what the coarse step and rounding cost


@dataclass(frozen=True)
class Schedule:
    """Constant commands from one message to the next; channels as in FTC_ACTUATOR.

    Attributes:
        times: Of each channel's messages [s], the first at 0, shape (messages,) each.
        values: Commands from then on, as shares of the limit.
    """

    times: tuple[np.ndarray, ...]
    values: tuple[np.ndarray, ...]

    @property
    def messages(self) -> int:
        """Messages of all channels."""
        return sum(map(len, self.times))

    def vector(self) -> np.ndarray:
        """Return what is optimised: all values, and all times but the first ones [10 s]."""
        return np.concatenate([*self.values, *(0.1 * times[1:] for times in self.times)])

    def with_vector(self, vector: np.ndarray, duration_s: float) -> "Schedule":
        """Return the schedule with other values and times; times are put in order."""
        counts = [len(times) for times in self.times]
        parts = np.split(vector, np.cumsum([*counts, *(n - 1 for n in counts)])[:-1])
        lows = [0.0 if c == THROTTLE else -1.0 for c in range(N_CHANNELS)]
        return Schedule(
            tuple(
                np.concatenate([[0.0], np.sort(np.clip(10.0 * part, 0.0, duration_s))])
                for part in parts[N_CHANNELS:]
            ),
            tuple(
                np.clip(part, low, 1.0) for part, low in zip(parts[:N_CHANNELS], lows, strict=True)
            ),
        )

    def commands(self, steps: int, step_us: int) -> np.ndarray:
        """Return the mean command of each control period, shape (steps, 4)."""
        edges = np.arange(steps + 1) * step_us / 1e6
        rows = []
        for times, values in zip(self.times, self.values, strict=True):
            lasts = np.diff(np.append(times, np.inf), prepend=0.0)[1:]
            until = np.clip(edges[:, None] - times, 0.0, lasts)  # time spent at each value so far
            rows.append(np.diff(until @ values) / (step_us / 1e6))
        return np.stack(rows, axis=1)

    def on_the_wire(self, step_us: int) -> "Schedule":
        """Return the schedule as it can be sent: times in whole periods, commands as float32."""
        dt = step_us / 1e6
        return Schedule(
            tuple(np.round(times / dt) * dt for times in self.times),
            tuple(values.astype(np.float32).astype(np.float64) for values in self.values),
        )


class Sky:
    """Follower 2 alone in scenario 1, flown open loop; nothing of it depends on its neighbours."""

    def __init__(self, scenario: Scenario, step_us: int) -> None:
        tree = scenario.model_dump()
        tree["uavs"] = [uav for uav in tree["uavs"] if uav["id"] == _FOLLOWER_2]
        tree["network"] = {"leader_access": {_FOLLOWER_2: 1.0}, "edges": []}
        tree["faults"] = [fault for fault in tree["faults"] if fault["uav"] == _FOLLOWER_2]
        self.scenario = Scenario.model_validate(tree | {"step_us": step_us})
        self.steps, self.step_us = self.scenario.steps, step_us
        self.budget = BUDGET
        self._start = new_plant_state(self.scenario.plant_config())
        for _, fault in self.scenario.fault_commands():
            limits = self.scenario.aircraft.fault_limits
            faults_of(self._start, 0, limits).set(fault.family, fault.params, 0.0)
        self.commanded = np.zeros((self.steps, 4))
        profile = profile_record(self.scenario.segments())
        for k in range(self.steps):
            profile_value(profile, k * step_us / 1e6, self.commanded[k])

    def error(self, schedule: Schedule) -> np.ndarray | None:
        """Return airspeed, roll, pitch, yaw minus the commands [m/s, deg], shape (steps, 4).

        None if the aircraft left the model's range.
        """
        fleet = copy.deepcopy(self._start)
        states = np.zeros((self.steps, 12))
        aircraft = fleet.uavs[0]["aircraft"]
        limits = np.array([*aircraft["stops"][:, 1], aircraft["thrust_limit"]])
        commands = schedule.commands(self.steps, self.step_us) * limits
        if not fly_open_loop(fleet, commands, self.step_us, states):
            return None
        airspeed = np.linalg.norm(states[:, 3:6], axis=1)
        error = np.column_stack([airspeed, states[:, 6:9]]) - self.commanded
        error[:, 1:] = (error[:, 1:] + np.pi) % (2.0 * np.pi) - np.pi
        return in_degrees(error)

    def ratios(self, error: np.ndarray) -> np.ndarray:
        """Return the IAEs relative to the budget."""
        return np.asarray(np.abs(error).sum(axis=0) * self.step_us / 1e6 / self.budget)


@compiled
def fly_open_loop(
    fleet: PlantState, commands: np.ndarray, step_us: int, states: np.ndarray
) -> bool:
    """Fly the commands of every step; return whether the aircraft stayed in the model's range.

    Args:
        fleet: The aircraft, updated in place.
        commands: Aileron, elevator, rudder [rad], thrust [N], shape (steps, 4).
        step_us: Period [µs].
        states: State at the beginning of each step, shape (steps, 12), written.
    """
    fleet.uavs[0]["message"]["actuator_time_usec"] = 0
    for k in range(len(commands)):
        states[k] = fleet.uavs[0]["state"]
        fleet.uavs[0]["controls"] = commands[k]
        if fly(fleet, k, step_us) >= 0:
            return False
    return True


def improve(sky: Sky, schedule: Schedule, rounds: int) -> tuple[Schedule, np.ndarray]:
    """Improve times and values: Levenberg and Marquardt's steps on reweighted squares.

    With the weights below, squares have the gradient of the sum of (IAE / budget)^6, which is
    nearly the gradient of the largest ratio.

    Args:
        sky: Where it flies.
        schedule: The schedule; it must not leave the model's range.
        rounds: Steps at most; it ends when all IAEs are within the budget.

    Returns:
        The schedule, and its IAEs relative to the budget.
    """
    duration_s, every = sky.scenario.duration_s, max(sky.steps // _SAMPLES, 1)
    error = sky.error(schedule)
    assert error is not None
    damping = 1e-3
    for _ in range(rounds):
        ratios = sky.ratios(error)
        if ratios.max() <= _MARGIN:
            break
        x, e = schedule.vector(), error[::every]
        weights = np.sqrt(ratios**5 / sky.budget / (np.abs(e) + _SOFT))
        columns = []
        for nudge in _STEP * np.eye(len(x)):
            moved = sky.error(schedule.with_vector(x + nudge, duration_s))
            change = np.zeros_like(e) if moved is None else (moved[::every] - e) / _STEP
            columns.append((change * weights).ravel())
        jacobian = np.stack(columns, axis=1)
        square, slope = jacobian.T @ jacobian, jacobian.T @ (e * weights).ravel()
        for _ in range(_TRIALS):
            step = np.linalg.solve(square + damping * np.diag(np.diag(square) + 1e-9), -slope)
            trial = schedule.with_vector(x + step, duration_s)
            flown = sky.error(trial)
            if flown is not None and (sky.ratios(flown) ** 6).sum() < (ratios**6).sum():
                schedule, error, damping = trial, flown, damping / 5.0
                break
            damping *= 5.0
        else:
            break
    return schedule, sky.ratios(error)


def with_one_more(sky: Sky, schedule: Schedule) -> Schedule:
    """Insert a message of the worst quantity's actuator in the middle of its largest error."""
    error = sky.error(schedule)
    assert error is not None
    worst = int(sky.ratios(error).argmax())
    c = ACTUATORS.index(_CHANNEL_OF[QUANTITIES[worst]])
    times, values = schedule.times[c], schedule.values[c]
    area = np.abs(error[:, worst])
    edges = np.append(times, sky.scenario.duration_s)
    t = np.arange(sky.steps) * sky.step_us / 1e6
    masses = [area[(t >= a) & (t < b)].sum() for a, b in itertools.pairwise(edges)]
    i = int(np.argmax(masses))
    inside = (t >= edges[i]) & (t < edges[i + 1])
    middle = t[inside][np.searchsorted(np.cumsum(area[inside]), masses[i] / 2.0)]
    all_times, all_values = list(schedule.times), list(schedule.values)
    all_times[c] = np.insert(times, i + 1, middle)
    all_values[c] = np.insert(values, i + 1, values[i])
    return Schedule(tuple(all_times), tuple(all_values))


def without(schedule: Schedule, gone: Collection[tuple[int, int]]) -> Schedule:
    """Return a schedule without some messages, by channel and number; a first one must stay."""
    kept = [
        [i for i in range(len(times)) if (c, i) not in gone]
        for c, times in enumerate(schedule.times)
    ]
    return Schedule(
        tuple(times[own] for times, own in zip(schedule.times, kept, strict=True)),
        tuple(values[own] for values, own in zip(schedule.values, kept, strict=True)),
    )


def search(
    sky: Sky, start: Schedule, rounds: int, on_found: Callable[[Schedule, np.ndarray], None]
) -> Schedule | None:
    """Search for the schedule with the fewest messages that is within the budget.

    Args:
        sky: Where it flies.
        start: Where to begin.
        rounds: Steps of `improve` for each schedule.
        on_found: Called with each schedule on the way, and its IAEs relative to the budget.

    Returns:
        The schedule; None if 200 messages are not enough.
    """
    schedule, ratios = improve(sky, start, rounds)
    on_found(schedule, ratios)
    while ratios.max() > _MARGIN:
        if schedule.messages >= _MAX_MESSAGES:
            return None
        schedule, ratios = improve(sky, with_one_more(sky, schedule), rounds)
        on_found(schedule, ratios)
    needed: set[tuple[int, float]] = set()  # messages that were tried in vain, at their times
    at_once = schedule.messages
    while True:
        jumps = sorted(
            (abs(values[i] - values[i - 1]), c, i)
            for c, values in enumerate(schedule.values)
            for i in range(1, len(values))
            if (c, float(schedule.times[c][i])) not in needed
        )
        if not jumps:
            return schedule
        at_once = min(at_once, -(-len(jumps) // 3))
        gone = [(c, i) for _, c, i in jumps[:at_once]]
        fewer = without(schedule, gone)
        if sky.error(fewer) is not None:
            fewer, ratios = improve(sky, fewer, rounds)
            if ratios.max() <= _MARGIN:
                schedule = fewer
                needed.clear()
                on_found(schedule, ratios)
                continue
        if at_once == 1:
            needed.update((c, float(schedule.times[c][i])) for c, i in gone)
        at_once = max(at_once // 2, 1)


def first_guess(scenario: Scenario, segments: int) -> Schedule:
    """Return messages at equal intervals, with the mean commands of a flight with feedback."""
    flight = fly_in_process(
        Scenario.model_validate(scenario.model_dump() | {"controller": {"kind": "backstepping"}})
    )
    held = flight.signals["held"][:, flight.uav_ids.index(_FOLLOWER_2)]
    aircraft = scenario.aircraft
    shares = held / np.array([*np.radians(aircraft.stops_deg)[:, 1], aircraft.thrust_limit_n])
    times = np.arange(segments) * scenario.duration_s / segments
    means = np.stack([part.mean(axis=0) for part in np.array_split(shares, segments)])
    return Schedule((times,) * N_CHANNELS, tuple(means.T))


def draw(sky: Sky, schedule: Schedule, folder: Path) -> None:
    """Draw errors and commands of a schedule into fewest_messages.png and .svg."""
    error = sky.error(schedule)
    assert error is not None
    t = np.arange(sky.steps) * sky.step_us / 1e6
    aircraft = sky.scenario.aircraft
    limits = [*(high for _, high in aircraft.stops_deg), aircraft.thrust_limit_n]
    figure = new_figure(4.6)
    panels = figure.subplots(2, len(QUANTITIES), sharex=True)
    for k, quantity in enumerate(QUANTITIES):
        name = _CHANNEL_OF[quantity]
        c = ACTUATORS.index(name)
        draw_curve(panels[0][k], t, error[:, k], **style(1).line)
        panels[0][k].set_title(f"error of {quantity} [{UNITS[quantity]}]", size=SMALL)
        times = np.append(schedule.times[c], sky.scenario.duration_s)
        values = np.append(schedule.values[c], schedule.values[c][-1]) * limits[c]
        panels[1][k].step(times, values, where="post", color=style(2).colour, lw=1.0)
        panels[1][k].plot(times[:-1], values[:-1], "o", ms=3, color=style(2).colour)
        unit = "N" if name == "throttle" else "deg"
        panels[1][k].set_title(f"{name} [{unit}], {len(times) - 1} messages", size=SMALL)
        for panel in panels[:, k]:
            tidy(panel, sky.scenario.duration_s)
    save(figure, folder, "fewest_messages")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--out", type=Path, required=True, help="folder of schedule and figure")
    parser.add_argument("--rounds", type=int, default=4, help="steps for each schedule")
    parser.add_argument("--segments", type=int, default=24, help="messages per channel at first")
    arguments = parser.parse_args()
    scenario = load_scenario("paper/scenario1")
    sky = Sky(scenario, _COARSE_US)
    begin, best = time.monotonic(), first_guess(scenario, arguments.segments)

    def report(schedule: Schedule, ratios: np.ndarray) -> None:
        listed = ", ".join(f"{q} {r:.3f}" for q, r in zip(QUANTITIES, ratios, strict=True))
        print(f"{time.monotonic() - begin:6.0f} s {schedule.messages:4d} {listed}", flush=True)

    found = search(sky, best, arguments.rounds, report)
    if found is None:
        raise SystemExit(f"no schedule of {_MAX_MESSAGES} messages is within the budget")
    fine = Sky(scenario, scenario.step_us)
    sent = found.on_the_wire(scenario.step_us)
    error = fine.error(sent)
    assert error is not None
    iae = fine.ratios(error) * BUDGET
    print("on the plant at 1 kHz, IAE:", ", ".join(f"{value:.2f}" for value in iae))
    print("within the paper's:", bool((iae <= BUDGET).all()))
    counts = {name: len(sent.times[ACTUATORS.index(name)]) for name in PAPER_ORDER}
    print("messages:", counts, "in all:", sent.messages)
    arguments.out.mkdir(parents=True, exist_ok=True)
    content = {
        "iae": dict(zip(QUANTITIES, map(float, iae), strict=True)),
        "messages": {
            name: [[float(t), float(v)] for t, v in zip(sent.times[c], sent.values[c], strict=True)]
            for c, name in enumerate(ACTUATORS)
        },
    }
    draw(fine, sent, arguments.out)
    write_text(arguments.out / "schedule.json", json.dumps(content, indent=1) + "\n")


if __name__ == "__main__":
    main()
