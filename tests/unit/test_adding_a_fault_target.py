"""A target of faults is added in the files that the architecture page lists, and fails."""

from pathlib import Path

import numpy as np
import pytest
from scratch_tree import ScratchTree, listed_files

COMMAND = """\
      <entry value="53190" name="MAV_CMD_FTC_SET_POWER_FAULT">
        <description>Set a fault of the power supply.</description>
        <param index="1" label="Power">1: the battery.</param>
        <param index="2" label="Kind" enum="FTC_POWER_FAULT_KIND">What the fault does.</param>
        <param index="3" label="Value" units="N">Thrust that is left.</param>
        <param index="4" label="Start" units="s">Start, exclusive. NaN: now.</param>
        <param index="5" label="End" units="s">End, inclusive. NaN: until cleared.</param>
        <param index="6">Empty (0)</param>
        <param index="7">Empty (0)</param>
      </entry>
"""
KINDS = """\
    <enum name="FTC_POWER_FAULT_KIND">
      <description>What a fault of the power supply does.</description>
      <entry value="0" name="FTC_POWER_FAULT_KIND_SAG"/>
    </enum>
"""
FIELD = """\
      <field type="uint8_t" name="power">Part of the power supply, 0: none.</field>
"""
TABLE = """
from mavlink_defs import dialect
from mavlink_defs.faults.kinds import Family, Kind, Target

POWER_FAULTS = Family(
    key="power",
    what="the power supply",
    targets=(Target("battery", dialect.FAILURE_UNIT_SYSTEM_BATTERY, "N"),),
    kinds=(
        Kind(
            "sag",
            dialect.FTC_POWER_FAULT_KIND_SAG,
            "leaves {size}",
            ("Thrust that is left.",),
            "{unit}",
            high=5000.0,
        ),
    ),
    command=dialect.MAV_CMD_FTC_SET_POWER_FAULT,
    params=("number", "code", "value", "start_s", "end_s", "", ""),
    most=4,
    first=1,
    title="Power fault",
    numbers="1",
    slots="slots of power faults",
)
"""
EFFECT = """
from mavlink_defs.faults.power import POWER_FAULTS


@compiled
def limit_thrust(uav, t):
    for fault in uav["power_faults"]:
        if fault["target"] < 0:
            break
        if fault["start"] <= t < fault["end"]:
            uav["controls"][THROTTLE] = min(uav["controls"][THROTTLE], fault["value"])


"""
ROWS = 'FaultTable(POWER_FAULTS, fleet.uavs[i]["power_faults"])'
EDITS = {
    "mavlink_defs/ftc.xml": [
        ('    <enum name="FTC_SENSOR">', KINDS),
        ("    </enum>\n  </enums>", COMMAND),
        ('    </message>\n    <message id="53107"', FIELD),
    ],
    "mavlink_defs/faults/power.py": [("", TABLE)],
    "mavlink_defs/faults/__init__.py": [
        ("FAMILIES = ", "from mavlink_defs.faults.power import POWER_FAULTS\n"),
        (')\n"""All families', ", POWER_FAULTS"),
    ],
    "sitl_plant/loop/fleet.py": [
        ("OUTSIDE = np.dtype(", EFFECT),
        ('        ("servos", SERVOS),', '        ("power_faults", FAULT, (4,)),\n'),
        ('        own["faults"]', '        own["power_faults"] = no_faults(POWER_FAULTS, 1)[0]\n'),
        ("    if navigates(fleet):\n        tables", f'    tables["power"] = {ROWS}\n'),
        ('        commanded = uav["message"]', "        limit_thrust(uav, t)\n"),
    ],
}
SCENARIO = """
extends: paper/scenario1
duration_s: 0.5
faults:
  - {uav: 3, power: battery, sag_n: 100.0, start_s: 0.1}
  - {uav: 3, actuator: rudder, effectiveness: 0.5, start_s: 0.1}
"""
USES = """
from gcs.scenario.model import load_scenario
from gcs.tui.fault_form import read_fault
from mavlink_defs.faults import COMMANDS
from mavlink_defs.faults.command import fault_from_params
from mavlink_defs.faults.fault import Fault
from sitl_plant.loop.fault_commands import faults_of
from sitl_plant.loop.fleet import new_plant_state

fault = read_fault("battery", "sag", {"value": "100", "start_s": "3"}).fault
assert fault.family.command in COMMANDS
assert repr(fault_from_params(fault.family, fault.params)) == repr(fault)
assert Fault.from_message(fault.resolved(0.0).message(0.0)) == fault.resolved(0.0)
print(fault.describe())
print(fault.as_dict(None)["sag_n"])

scenario = load_scenario("paper/scenario1")
faults = faults_of(new_plant_state(scenario.plant_config()), 2, scenario.aircraft.fault_limits)
faults.set(fault.family, fault.params, 0.0)
print(*(one.whose for one in faults.listed()))
faults.inject((fault.target.failure_unit, 0, 0), 0.0)
print(*(one.whose for one in faults.listed()))
"""


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> ScratchTree:
    return ScratchTree(tmp_path_factory.mktemp("tree"), EDITS)


def test_the_page_lists_the_files() -> None:
    listed = listed_files("a target of faults, such as a battery")
    assert listed == {name.replace("power", "*") for name in EDITS}


def test_its_fault_flies(tree: ScratchTree, tmp_path: Path) -> None:
    (tmp_path / "sag.yaml").write_text(SCENARIO)
    out = tmp_path / "run"
    options = ("--in-process", "--record", "npz", "--json", "--out", str(out))
    tree.run("-m", "gcs", "fly", str(tmp_path / "sag.yaml"), *options)
    with np.load(out / "trajectory.npz") as flown:
        thrust, late = flown["applied"][:, :, 3], flown["time_s"] > 0.4
    assert thrust[late, 2].max() <= 100.0 < thrust[late, :2].min()


def test_forms_commands_and_texts_know_it(tree: ScratchTree) -> None:
    assert tree.run("-c", USES).splitlines() == [
        "battery leaves 100 N after 3 s, until cleared",
        "100.0",
        "battery",
        "",
    ]
