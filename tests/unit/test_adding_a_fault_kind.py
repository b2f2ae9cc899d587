"""A kind of fault is added in the files that the architecture page lists, and flown."""

import json
from pathlib import Path

import numpy as np
import pytest
from scratch_tree import ScratchTree, listed_files

EDITS = {
    "mavlink_defs/ftc.xml": [
        (
            '    </enum>\n    <enum name="FTC_SIM_FLAGS"',
            '      <entry value="4" name="FTC_FAULT_KIND_SHOCK">\n'
            "        <description>It adds value / (1 + t - start).</description>\n"
            "      </entry>\n",
        )
    ],
    "mavlink_defs/faults/actuators.py": [
        (
            "\nMAX_FAULTS =",
            'SHOCK = Kind("shock", dialect.FTC_FAULT_KIND_SHOCK, "shocked by {minus}{size}",'
            ' ("Shock of a surface.", "Shock of the throttle."), "{unit}", partial=True)\n',
        ),
        ("),\n    command=", ", SHOCK"),
    ],
    "sitl_plant/actuators/faults.py": [
        ("\n@compiled\ndef offset", "from mavlink_defs.dialect import FTC_FAULT_KIND_SHOCK\n"),
        (
            "    wave: float",
            '    if fault["code"] == FTC_FAULT_KIND_SHOCK:\n'
            '        return float(fault["value"] / (1.0 + since))\n',
        ),
    ],
}
SCENARIO = """
extends: paper/scenario1
duration_s: 0.5
faults:
  - {uav: 3, actuator: rudder, shock_deg: 4.0, start_s: 0.1}
"""
USES = """
from ftc_lab.campaigns.faults import DrawnFault
from gcs.tui.fault_form import read_fault
from mavlink_defs.dialect import MAVLink_ftc_fault_message
from mavlink_defs.faults.command import fault_from_params
from mavlink_defs.faults.fault import Fault

texts = {"value": "-2", "effectiveness": "0.5", "start_s": "3"}
fault = read_fault("throttle", "shock", texts).fault
assert fault_from_params(fault.family, fault.params)[:4] == fault[:4]
listed = MAVLink_ftc_fault_message(0.5, -2.0, 0.0, 3.0, float("inf"), 0, 1, 3, 1, fault.code)
print(Fault.from_message(listed).describe())
print(Fault.from_message(listed).as_dict(None)["shock_n"])
one = {"kind": "uniform", "low": 0.1, "high": 0.2}
DrawnFault.model_validate({"kinds": {"shock": one}, "start_s": one})
"""


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> ScratchTree:
    return ScratchTree(tmp_path_factory.mktemp("tree"), EDITS)


def test_the_page_lists_the_files() -> None:
    assert listed_files("a kind of fault") == set(EDITS)


def test_the_kind_flies(tree: ScratchTree, tmp_path: Path) -> None:
    (tmp_path / "shock.yaml").write_text(SCENARIO)
    out = tmp_path / "run"
    options = ("--in-process", "--record", "npz", "--json", "--out", str(out))
    summary = json.loads(tree.run("-m", "gcs", "fly", str(tmp_path / "shock.yaml"), *options))
    assert summary["loss"] is None
    with np.load(out / "trajectory.npz") as flown:
        shock = flown["applied"][:, 2, 2] - flown["held"][:, 2, 2]
        since = flown["time_s"] - 0.1
        expected = np.where(since < -1e-9, 0.0, np.radians(4.0) / (1.0 + since))
    assert shock == pytest.approx(expected, abs=1e-6)


def test_forms_commands_texts_and_campaigns_know_it(tree: ScratchTree) -> None:
    assert tree.run("-c", USES).splitlines() == [
        "throttle at 50 % shocked by -2 N after 3 s, until cleared",
        "-2.0",
    ]
    assert "--shock" in tree.run("-m", "gcs", "fault", "set", "--help")
