"""How well the estimator's covariance describes its errors: NEES and NIS of many seeds.

    python -m benchmarks.consistency
    python -m benchmarks.consistency --scenario missions/race_track --seeds 20
    python -m benchmarks.consistency --grade tactical
    python -m benchmarks.consistency --airframe c172p

A flight by the true state is flown once, and the estimator follows it with sensors of many seeds:
states, specific force and wind are the plant's, or the simulator's. NEES of parts shows where an
error is that the covariance does not know.
NEES is eᵀ P⁻¹ e of attitude, velocity, position and horizontal wind, NIS the squared innovation
over its variance. Of a consistent filter their means have chi-square distributions (Y. Bar-Shalom
et al., Estimation with Applications to Tracking and Navigation, 2001, section 5.4): 95 % of them
lie within the bounds. The figure of the default flight goes to docs/images/consistency.png.
"""

import argparse
import math
import multiprocessing
import os
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.stats import chi2

from ftc_autopilot.estimation.estimator import Estimator, EstimatorConfig, estimate, new_estimator
from ftc_autopilot.estimation.state import AIDING, SIDESLIP, N
from gcs.fleet.in_process import begin, fly_on
from gcs.reports.figures.style import SINGLE, decimated, draw_legend, letter, new_figure, save, tidy
from gcs.results.recording import Steps
from gcs.scenario.changes import with_changes
from gcs.scenario.model import Scenario
from mavlink_defs.constants import BAROMETER, GNSS, MAGNETOMETER
from mavlink_defs.framing.codec import SIM_STATE, SIM_STEP
from mavlink_defs.runtime.jit import compiled
from sitl_plant.airframe.rigid_body import R1
from sitl_plant.loop.fleet import new_sensing
from sitl_plant.sensing.config import Sensors
from sitl_plant.sensing.sense import Sensing, sense
from sitl_plant.sensing.units import FAULT_NAMES

EVERY = 100
"""Steps from sample to sample."""
SCENARIO = "paper/scenario1"
JUDGED = (0, 1, 2, 3, 4, 5, 6, 7, 8, 15, 16)
"""Elements of the error whose NEES is taken: all but biases and vertical wind."""
PARTS = {
    "attitude": (0, 1, 2),
    "velocity": (3, 4, 5),
    "position": (6, 7, 8),
    "wind": (15, 16),
}
_EXPECTED = {MAGNETOMETER: " (the largest of 3: 2.1)", GNSS: " (the largest of 2: 1.6)"}
IMAGES = Path(__file__).parent.parent / "docs" / "images"


class Followed(NamedTuple):
    """What the estimator made of a flight, m samples, and the truth."""

    error: np.ndarray  # (m, N): true less estimated; biases are not in it
    covariance: np.ndarray  # (m, N, N)
    measured: np.ndarray  # (m, 15): position NED, velocity body, attitude, rates, wind body
    true: np.ndarray  # (m, 15): the same
    ratios: np.ndarray  # (m, SIDESLIP + 1): squared normalised innovations, by sensor
    bad: np.ndarray  # (m, 2): bits of excluded IMUs and sensors
    estimator: Estimator


def flown(scenario: Scenario) -> np.ndarray:
    """Fly a scenario by the true state; return its motion by step, shape (steps, n, 18).

    Position NED, velocity body, attitude, rates, specific force, wind body: what the plant has.
    """
    exact = {"navigation": "true_state", "sensors": Sensors()}
    scenario = scenario.model_copy(update=exact)
    flight, n = begin(scenario), len(scenario.uavs)
    steps = Steps.room(scenario.steps, n)
    force = np.zeros((scenario.steps, n, 3))
    for k in range(scenario.steps):
        end_s = (k + 1) * scenario.step_us / 1e6
        part = scenario.model_copy(update={"duration_s": end_s})
        loss = fly_on(part, flight, steps.part, first=k).loss
        if loss is not None:
            raise SystemExit(f"{scenario.name}: {loss}")
        force[k] = flight.fleet.uavs["message"]["specific_force"]
    return np.concatenate([steps.states, force, steps.wind], axis=2)


def follow(scenario: Scenario, motion: np.ndarray, seed: int, i: int = 0) -> Followed:
    """Let the estimator follow an aircraft through a flight by the sensors of a seed.

    Args:
        scenario: What was flown.
        motion: How, as of `flown`.
        seed: Of the sensors.
        i: Index of the aircraft.
    """
    plant = scenario.plant_config(speed=None).model_copy(update={"seed": seed})
    aircraft = scenario.aircraft_of(scenario.uavs[i].id)
    estimator = new_estimator(
        EstimatorConfig(plant.sensors.navigation, plant.origin, scenario.step_us, aircraft)
    )
    true = np.ascontiguousarray(motion[:, i])
    samples = -(-len(true) // EVERY)
    out = Followed(
        np.zeros((samples, N)),
        np.zeros((samples, N, N)),
        np.zeros((samples, 15)),
        true[::EVERY, [*range(12), 15, 16, 17]],
        np.zeros((samples, SIDESLIP + 1)),
        np.zeros((samples, 2)),
        estimator,
    )
    records = np.zeros(2, SIM_STATE)
    state, history = estimator.state[0], estimator.history
    _follow(true, new_sensing(plant), i, state, history, np.zeros(1, SIM_STEP), records, *out[:6])
    return out


@compiled
def _follow(
    true: np.ndarray,
    sensing: Sensing,
    i: int,
    estimator: np.void,
    history: np.ndarray,
    sim_step: np.ndarray,
    records: np.ndarray,
    error: np.ndarray,
    covariance: np.ndarray,
    measured: np.ndarray,
    _true: np.ndarray,
    ratios: np.ndarray,
    bad: np.ndarray,
) -> None:
    truth, estimated = records[0], records[1]
    step_us = estimator["parameters"]["step_us"]
    for k in range(len(true)):
        truth["time_usec"], truth["step"] = k * step_us, k
        for axis in range(3):
            truth["position"][axis] = true[k, axis]
            truth["velocity"][axis] = true[k, 3 + axis]
            truth["attitude"][axis] = true[k, 6 + axis]
            truth["rates"][axis] = true[k, 9 + axis]
            truth["specific_force"][axis] = true[k, 12 + axis]
            truth["wind"][axis] = true[k, 15 + axis]
        sim_step[0]["step"], sim_step[0]["time_usec"] = k, k * step_us
        delivered = sense(sensing, i, k, truth)
        estimate(
            estimator, history, sensing.imus[i], sensing.gps[i], delivered, sim_step[0], estimated
        )
        if k % EVERY != 0:
            continue
        row = k // EVERY
        filter_ = estimator["filters"][estimator["progress"]["imu"]]
        _note_error(truth, filter_, error[row])
        for axis in range(3):
            measured[row, axis] = estimated["position"][axis]
            measured[row, 3 + axis] = estimated["velocity"][axis]
            measured[row, 6 + axis] = estimated["attitude"][axis]
            measured[row, 9 + axis] = estimated["rates"][axis]
            measured[row, 12 + axis] = estimated["wind"][axis]
        for r in range(N):
            for c in range(N):
                covariance[row, r, c] = filter_["P"][r, c]
        for s in range(ratios.shape[1]):
            ratios[row, s] = estimator["report"]["ratios"][s]
        bad[row, 0] = estimator["report"]["bad_imus"]
        bad[row, 1] = estimator["report"]["bad_sensors"]


@compiled
def _note_error(truth: np.void, filter_: np.void, error: np.ndarray) -> None:
    """Write true less estimated values: rotation vector, velocity, position, wind, all NED."""
    true = R1((truth["attitude"][0], truth["attitude"][1], truth["attitude"][2]))
    w, x, y, z = filter_["quaternion"]
    own = (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
        (2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
        (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
    )
    for axis in range(3):
        a, b = (axis + 2) % 3, (axis + 1) % 3
        turn, velocity, wind = 0.0, 0.0, 0.0
        for c in range(3):
            turn += true[a][c] * own[b][c] - true[b][c] * own[a][c]
            velocity += true[axis][c] * truth["velocity"][c]
            wind += true[axis][c] * truth["wind"][c]
        error[axis] = 0.5 * turn
        error[3 + axis] = velocity - filter_["x"][3 + axis]
        error[6 + axis] = truth["position"][axis] - filter_["x"][6 + axis]
        error[15 + axis] = wind - filter_["x"][15 + axis]


def nees(followed: Followed, judged: Sequence[int] = JUDGED) -> np.ndarray:
    """Return eᵀ P⁻¹ e of each sample over the number of elements, shape (m,)."""
    e = followed.error[:, judged]
    covariance = followed.covariance[np.ix_(range(len(e)), judged, judged)]
    weighted = np.linalg.solve(covariance, e[..., None])[..., 0]
    normalised: np.ndarray = np.sum(e * weighted, axis=1) / len(judged)
    return normalised


def bounds(degrees: int, share: float = 0.95) -> tuple[float, float]:
    """Return the bounds of a chi-square variable over its degrees of freedom."""
    low, high = chi2.ppf([(1.0 - share) / 2.0, (1.0 + share) / 2.0], degrees) / degrees
    return float(low), float(high)


def airspeed_error(followed: Followed) -> np.ndarray:
    """Return the error of the airspeed of each sample [m/s]."""
    speeds = [
        np.linalg.norm(part[:, 3:6] - part[:, 12:15], axis=1)
        for part in (followed.measured, followed.true)
    ]
    difference: np.ndarray = speeds[0] - speeds[1]
    return difference


def attitude_error(followed: Followed) -> np.ndarray:
    """Return the errors of roll, pitch, yaw that the laws see [deg], shape (m, 3)."""
    turned = followed.measured[:, 6:9] - followed.true[:, 6:9]
    error: np.ndarray = np.degrees((turned + math.pi) % (2.0 * math.pi) - math.pi)
    return error


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--scenario", default=SCENARIO)
    parser.add_argument("--airframe", help="a scenario of scenarios/airframes, such as c172p")
    parser.add_argument("--grade", choices=("consumer", "tactical"), default="consumer")
    parser.add_argument("--seeds", type=int, default=100)
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    options = parser.parse_args()
    name = f"airframes/{options.airframe}" if options.airframe else options.scenario
    scenario = _by_sensors(name, options.grade)
    motion = flown(scenario)
    with multiprocessing.get_context("spawn").Pool(options.jobs) as pool:
        one = partial(_follow_seed, name, options.grade, motion[:, :1])
        runs = pool.map(one, range(1, options.seeds + 1))
    _print(runs, scenario.step_us / 1e6)
    if (name, options.grade) == (SCENARIO, "consumer"):
        _draw(runs, scenario.step_us / 1e6)


def _by_sensors(name: str, grade: str) -> Scenario:
    return with_changes(name, ["estimated"], {"sensors.navigation.grade": grade})


def _follow_seed(name: str, grade: str, motion: np.ndarray, seed: int) -> Followed:
    """Follow by the sensors of a seed, in another process: no scenario can be sent there."""
    return follow(_by_sensors(name, grade), motion, seed)


def _print(runs: list[Followed], step_s: float) -> None:
    late = round(10.0 / (EVERY * step_s))
    attitude = np.array([attitude_error(run)[late:] for run in runs])
    position = np.array([run.error[late:, 6:9] for run in runs])
    wind = np.array([run.error[late:, 15:17] for run in runs])
    airspeed = np.array([airspeed_error(run)[late:] for run in runs])

    def rms(x: np.ndarray) -> str:
        return " ".join(f"{v:.2f}" for v in np.atleast_1d(np.sqrt(np.mean(x**2, axis=(0, 1)))))

    print(f"{len(runs)} seeds, after 10 s, rms")
    print(f"roll, pitch, yaw [deg]      {rms(attitude)}")
    print(f"airspeed [m/s]              {rms(airspeed)}")
    print(f"wind north, east [m/s]      {rms(wind)}")
    print(f"position N, E, D [m]        {rms(position)}")
    mean = np.mean([nees(run) for run in runs], axis=0)
    low, high = bounds(len(runs) * len(JUDGED))
    inside = np.mean((mean[late:] > low) & (mean[late:] < high))
    print(f"NEES {mean[late:].mean():.2f}, within {low:.2f} to {high:.2f} for {inside:.0%} of time")
    for name, part in PARTS.items():
        print(f"NEES of {name:11s}{np.mean([nees(run, part)[late:] for run in runs]):.2f}")
    for s in (*AIDING, SIDESLIP):
        ratios = np.array([run.ratios[late:, s] for run in runs])
        name = "sideslip" if s == SIDESLIP else FAULT_NAMES[s]
        print(f"NIS {name:13s} {ratios.mean():.2f}{_EXPECTED.get(s, '')}")
    excluded = sum(bool(run.bad.any()) for run in runs)
    print(f"{excluded} of {len(runs)} flights without a fault exclude a sensor")


def _draw(runs: list[Followed], step_s: float) -> None:
    figure = new_figure(6.0)
    panels = figure.subplots(2, 1)
    t = np.arange(len(runs[0].error)) * EVERY * step_s
    groups = [np.mean([nees(run) for run in runs], axis=0)]
    groups.append(np.mean([run.ratios[:, BAROMETER] for run in runs], axis=0))
    degrees = (len(runs) * len(JUDGED), len(runs))
    names = ("NEES per element", "NIS of the barometer")
    for k, (axis, values) in enumerate(zip(panels, groups, strict=True)):
        low, high = bounds(degrees[k])
        axis.axhspan(low, high, color="0.88", lw=0, zorder=-1, label="95 %")
        axis.plot(*decimated(t, values), color=SINGLE, lw=1.2, label=f"mean of {len(runs)} seeds")
        axis.set_ylabel(names[k])
        axis.set_ylim(0.0, 3.0)
        letter(axis, k)
        tidy(axis, float(t[-1]))
    draw_legend(figure)
    save(figure, IMAGES, "consistency")


if __name__ == "__main__":
    main()
