"""Flights of our own, from which is learnt what evidence by a model means."""

from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from ftc_lab.flight_diagnosis.by_model import SURFACE_OF, flown_run, relations_by_model
from ftc_lab.flight_diagnosis.decisions import watch
from ftc_lab.flight_diagnosis.examples import Example
from gcs.api.flying import fly
from gcs.results.logs.read import read_flight
from gcs.scenario.aircraft_file import load_aircraft
from mavlink_defs.constants import ACTUATORS, THROTTLE
from sitl_plant.airframe.config import Aircraft

_FLOWN = (  # scenario, aircraft, law
    ("paper/scenario1", "paper", "surviving"),
    ("airframes/aerosonde_designed", "aerosonde", "surviving"),
    ("airframes/minisgs", "minisgs", "surviving"),  # JSBSim's, which no model of ours is exactly
    ("airframes/c172p", "c172p", "surviving"),
)
_ADDITIONS: tuple[tuple[str, ...], ...] = (("turbulent",), ("realistic",))
_FAULTY = 3  # system id


def simulated_examples(flights: int, seed: int) -> Iterator[Example]:
    """Fly scenarios with random faults of one UAV; yield its flight and one of another."""
    rng = np.random.default_rng(seed)
    for k in range(flights):
        scenario, name, law = _FLOWN[k % len(_FLOWN)]
        aircraft = load_aircraft(name)
        j = int(rng.integers(len(ACTUATORS)))
        start_s = round(float(rng.uniform(6.0, 16.0)), 2)
        fault = _fault(rng, j, aircraft) | {"start_s": start_s}
        changes = {"faults": [fault], "controller.kind": law, "seed": k + 1}
        with TemporaryDirectory() as folder:
            run = Path(folder) / "run"
            fly(scenario, changes, overlays=_ADDITIONS[k // len(_FLOWN) % len(_ADDITIONS)], out=run)
            for uav, truth in ((_FAULTY, SURFACE_OF[ACTUATORS[j]]), (1, None)):
                relations = relations_by_model(flown_run(run, read_flight(run, uav), uav), aircraft)
                onset_s = start_s if truth else np.inf
                title = f"{scenario} {law} {k}, UAV {uav}: {fault}"
                yield Example(title, truth, onset_s, relations, watch(relations))


def _fault(rng: np.random.Generator, j: int, aircraft: Aircraft) -> dict[str, object]:
    """Draw a fault of actuator j as campaigns do: a loss, a bias, or stuck."""
    unit = "n" if j == THROTTLE else "deg"
    most = aircraft.thrust_limit_n if j == THROTTLE else aircraft.stops_deg[j][1]
    fault: dict[str, object] = {"uav": _FAULTY, "actuator": ACTUATORS[j]}
    kind, share = rng.choice(["loss", "bias", "stuck"]), float(rng.uniform(-0.3, 0.3))
    if kind == "loss":
        fault["effectiveness"] = round(float(rng.uniform(0.0, 0.6)), 2)
    elif kind == "bias":
        fault[f"bias_{unit}"] = round(share * most, 2)
    else:
        fault[f"stuck_{unit}"] = round(abs(share) * most if j == THROTTLE else share * most, 2)
    return fault
