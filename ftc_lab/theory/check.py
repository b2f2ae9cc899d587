"""The paper's theorems against one flight: dwell times, residual sets, proofs."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from ftc_autopilot.control.laws.proposed import Proposed
from ftc_autopilot.control.triggers import Trigger
from ftc_autopilot.control.triggers.periodic import Periodic
from ftc_lab.theory.definitions import attitude_definitions, speed_definitions
from ftc_lab.theory.dwell import dwell_times
from ftc_lab.theory.ground_truth import known_quantities, present_steps
from ftc_lab.theory.judgement import Judgement, judge
from ftc_lab.theory.lyapunov import attitude_subsystem, speed_subsystem
from ftc_lab.theory.residual import residual_sets
from gcs.results.recording import Recording
from gcs.scenario.model import Scenario
from mavlink_defs.constants import N_CHANNELS, THROTTLE
from sitl_plant.actuators.config import ActuatorServos
from sitl_plant.air.config import Wind

_SURFACES = tuple(i for i in range(N_CHANNELS) if i != THROTTLE)


@dataclass(frozen=True)
class UavTheory:
    """The findings about one UAV.

    Attributes:
        id: System id.
        missing_steps: Steps without a complete record: the autopilot missed them, or a number is
            not finite. They are excluded from all checks.
        dwell: As `dwell_times` returns it.
        residual: As `residual_sets` returns it.
        proofs: `speed` (Theorem 1) and `attitude` (Theorem 2); empty under another law.
    """

    id: int
    missing_steps: int
    dwell: dict[str, Any]
    residual: list[dict[str, Any]]
    proofs: dict[str, Judgement]


@dataclass(frozen=True)
class Theory:
    """The findings about one flight; `dataclasses.asdict` makes it ready for JSON.

    Attributes:
        scenario: Its name.
        controller: Kind of law.
        trigger_mode: Name of the trigger.
        period_s: Control period.
        duration_s: Simulated time flown.
        loss: Why the flight ended early, or None.
        proofs_absent: Why the proofs were not checked, or None.
        uavs: In the order of the recording.
    """

    scenario: str
    controller: str
    trigger_mode: str
    period_s: float
    duration_s: float
    loss: str | None
    proofs_absent: str | None
    uavs: list[UavTheory]


def check_theory(recording: Recording, scenario: Scenario) -> Theory:
    """Check one flight against the paper's theorems.

    Args:
        recording: The flight, lost or complete.
        scenario: The scenario that it flew.
    """
    law = scenario.controller
    absent = None
    if not isinstance(law, Proposed):
        absent = f"the theorems speak of the paper's law; this flight's is '{law.kind}'"
    elif (unlike := _unlike_the_papers(scenario)) is not None:
        absent = f"the theorems know no {unlike}; this flight has them"
    elif len(recording.states) < 2:
        absent = "the flight is shorter than two steps"
    uavs = []
    for i, uav_id in enumerate(recording.uav_ids):
        proofs = {}
        if isinstance(law, Proposed) and absent is None:
            proofs = _proofs(recording, i, scenario, law)
        uavs.append(
            UavTheory(
                id=uav_id,
                missing_steps=int(np.count_nonzero(~present_steps(recording, i))),
                dwell=dwell_times(recording, i, scenario),
                residual=residual_sets(recording, i, scenario),
                proofs=proofs,
            )
        )
    return Theory(
        scenario=scenario.name,
        controller=law.kind,
        trigger_mode=scenario.trigger.mode,
        period_s=recording.step_us / 1e6,
        duration_s=recording.duration_s,
        loss=recording.loss,
        proofs_absent=absent,
        uavs=uavs,
    )


def _unlike_the_papers(scenario: Scenario) -> str | None:
    """Return which parts of the aircraft or the air the paper's model does not have."""
    plant = scenario.plant_config()
    parts = {
        "servos": any(uav.servos != ActuatorServos() for uav in plant.uavs),
        "propulsion models": any(uav.aircraft.propulsion is not None for uav in plant.uavs),
        "errors of sensors": not plant.sensors.exact,
        "motions of the air": plant.wind != Wind(),
        "other triggers than (25), (29)": not _papers(scenario.trigger),
        "limits of (57)": getattr(scenario.controller, "omega_d_limit_deg_s", 0.0) > 0.0,
    }
    return ", ".join(name for name, there in parts.items() if there) or None


def _papers(trigger: Trigger) -> bool:
    """Return whether the paper has the trigger: (25) and (29), or none at all."""
    return trigger.mode in {"per_channel", "joint"} or (
        isinstance(trigger, Periodic) and not any(trigger.by_channel().values())
    )


def _proofs(
    recording: Recording, i: int, scenario: Scenario, law: Proposed
) -> dict[str, Judgement]:
    known, trigger = known_quantities(recording, i, scenario), scenario.trigger
    errors = known.signals["sync_error"]
    with np.errstate(all="ignore"):  # a lost flight may end in NaN or inf
        return {
            "speed": judge(
                known,
                (THROTTLE,),
                speed_subsystem(known, law, trigger),
                speed_definitions(known, law, trigger),
                np.abs(errors[:, 0]),
                "m/s",
            ),
            "attitude": judge(
                known,
                _SURFACES,
                attitude_subsystem(known, law, trigger),
                attitude_definitions(known, law, trigger),
                np.degrees(np.linalg.norm(errors[:, 1:], axis=1)),
                "deg",
            ),
        }
