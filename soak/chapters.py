"""The chapters of a soak: flights whose faults, crashes and impairments follow from a seed."""

from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Any

from gcs.scenario.model import Scenario, scenario_of, scenario_tree

_STEPS_PER_S = 1000
_LAWS = ("proposed", "surviving", "tube", "backstepping", "pid")
_SURFACES = ("aileron", "elevator", "rudder")


@dataclass(frozen=True)
class Chapter:
    """One flight of a soak.

    Attributes:
        scenario: What is flown.
        crashes: Steps after which autopilots crash, by UAV, one for each start.
        lossy: Whether datagrams of the simulator link are lost.
    """

    scenario: Scenario
    crashes: dict[int, list[int]]
    lossy: bool


def chapter(seed: int, number: int, uavs: int, duration_s: float) -> Chapter:
    """Draw a chapter; the same arguments give the same one.

    Args:
        seed: Of the soak.
        number: Of the chapter.
        uavs: Number of UAVs, at least 2.
        duration_s: Simulated time [s].
    """
    random = Random(f"{seed} {number}")
    ids = range(1, uavs + 1)
    tree = scenario_tree(Path("paper/scenario1"))
    first = tree["uavs"][0]
    lossy = random.random() < 0.25
    faults = [_fault(random, ids, duration_s) for _ in range(random.randint(0, 3))]
    law = random.choice(_LAWS)
    tree |= {
        "name": f"soak, seed {seed}, chapter {number}",
        "duration_s": duration_s,
        "seed": random.randrange(2**31),
        "controller": {"kind": law},
        "uavs": [_uav(first, i, random) for i in ids],
        "network": {
            "leader_access": {1: 1.0},
            "edges": [
                {"between": [random.randrange(1, i), i], "weight": 1.0} for i in range(2, uavs + 1)
            ],
        },
        "profile": _profile(random, duration_s),
        "faults": list({(f["uav"], f["actuator"]): f for f in faults}.values()),  # none overlap
        "links": {
            "impairments": {
                "plant": {"loss": 1e-4, "seed": random.randrange(2**31)} if lossy else {},
                "formation": {
                    "loss": random.choice((0.0, 1e-4)),
                    "duplicate": random.choice((0.0, 0.01)),
                    "bit_errors": random.choice((0.0, 1e-7)),
                    "seed": random.randrange(2**31),
                },
            }
        },
    }
    steps = round(duration_s * _STEPS_PER_S)
    crashes: dict[int, list[int]] = {}
    for _ in range(random.randint(0, 2)):
        crashes.setdefault(random.choice(ids), []).append(random.randrange(1, max(steps // 2, 2)))
    crashes = {uav: sorted(at) for uav, at in crashes.items()}
    return Chapter(scenario_of("soak", tree), crashes, lossy)


def _uav(first: dict[str, Any], i: int, random: Random) -> dict[str, Any]:
    initial = {
        **first["initial"],
        "north_m": 40.0 * i,
        "east_m": random.uniform(-20.0, 20.0),
        "airspeed_m_s": random.uniform(39.0, 41.0),
    }
    return {"id": i, "name": f"UAV {i}", "initial": initial}


def _profile(random: Random, duration_s: float) -> list[dict[str, Any]]:
    """Return level flight, then three segments at random times."""
    starts = sorted(round(random.uniform(0.05, 0.95) * duration_s, 3) for _ in range(3))
    level = {"start_s": 0.0, "airspeed_m_s": 40.0}
    turns = [
        {
            "start_s": start_s,
            "airspeed_m_s": round(random.uniform(38.0, 50.0), 2),
            "roll_deg": round(random.uniform(-8.0, 8.0), 2),
            "pitch_deg": round(random.uniform(-3.0, 5.0), 2),
            "yaw_deg": round(random.uniform(-20.0, 20.0), 2),
        }
        for start_s in starts
    ]
    return [level, *turns]


def _fault(random: Random, ids: range, duration_s: float) -> dict[str, Any]:
    """Return a loss of effectiveness of any actuator, or a surface stuck for a while."""
    start_s = round(random.uniform(0.05, 0.6) * duration_s, 3)
    fault: dict[str, Any] = {"uav": random.choice(ids), "start_s": start_s}
    if random.random() < 0.5:
        effectiveness = round(random.uniform(0.4, 0.95), 3)
        return fault | {
            "actuator": random.choice((*_SURFACES, "throttle")),
            "effectiveness": effectiveness,
        }
    return fault | {
        "actuator": random.choice(_SURFACES),
        "stuck_deg": round(random.uniform(-3.0, 3.0), 2),
        "end_s": round(start_s + min(1.0, 0.1 * duration_s), 3),
    }
