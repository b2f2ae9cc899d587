"""``--with`` and ``--set``: the scenario that is flown."""

from pathlib import Path

from gcs.commands.common import changed_scenario
from gcs.scenario.model import load_scenario

FAULT = Path("faults/loe_aileron")


def test_nothing_changes_nothing() -> None:
    assert changed_scenario(FAULT, None, None) == load_scenario(FAULT)


def test_additions_and_settings_come_one_after_the_other(tmp_path: Path) -> None:
    own = tmp_path / "own.yaml"
    own.write_text("servos: {surfaces: {lag_s: 0.05}}\nsensors: null\n")
    settings = ["trigger.b2_deg=2", "controller.K1=[1, 2, 3]", "servos.rudder={lag_s: 0.1}"]
    flown = changed_scenario(FAULT, ["realistic", str(own)], settings)
    assert flown.faults == load_scenario(FAULT).faults
    assert flown.servos.surfaces.lag_s == 0.05
    assert flown.servos.surfaces.rate_limit_deg_s == 400.0
    assert flown.servos.rudder is not None
    assert flown.servos.rudder.lag_s == 0.1
    assert flown.sensors == load_scenario(FAULT).sensors
    assert flown.trigger.b2_deg.root == 2.0


def test_the_flights_name_tells_the_changes() -> None:
    plain = load_scenario(FAULT).name
    flown = changed_scenario(FAULT, ["realistic"], ["seed=2", "uavs[0].name=boss"])
    assert flown.name == f"{plain}, with realistic, seed = 2, uavs[0].name = boss"
    assert changed_scenario(FAULT, ["realistic"], ["name=mine"]).name == "mine"
