"""Law of a file that fails on one UAV of a standing fleet."""

from pathlib import Path

import pytest
from flying import wait_until
from station import status_when, up

from mavlink_defs.capture.tlog import read_tlog

pytestmark = pytest.mark.sitl

LAW = """\
from ftc_autopilot.control.laws.base import LawParameters
from ftc_autopilot.control.step import ALL, Command
from mavlink_defs.config.quantity import quantity


class Fragile(LawParameters):
    kind: str = "fragile"
    crash: float = quantity("", ge=0.0, le=1.0, default=0.0, doc="1: fail.")

    @staticmethod
    def step(now, aircraft, gains, state):
        if gains["crash"] > 0.5:
            raise ValueError("asked to")
        return Command((0.0, -0.05, 0.0), 900.0, ALL)
"""


def test_a_law_that_fails_on_one_uav_leaves_the_others_and_their_supervision(
    tmp_path: Path,
) -> None:
    (tmp_path / "law.py").write_text(LAW)
    tree = {
        "extends": "paper/scenario1",
        "faults": [],
        "controller": {"kind": str(tmp_path / "law.py:Fragile")},
    }
    with up(tmp_path, "--start", "--speed", "0.2", tree=tree) as fleet:
        done = fleet.gcs("param", "set", "CRASH", "1", "--uav", "2")
        assert done.returncode == 0, done.stderr

        def steps() -> dict[int, int]:
            seen = status_when(fleet, lambda s: len(s) == 3 and all(one["steps"] for one in s))
            return {one["uav"]: one["steps"] for one in seen["vehicles"]}

        log = fleet.folder / "processes" / "uav2.log"
        failure = "the law law.py:Fragile failed"
        wait_until(lambda: failure in log.read_text(), "the failure in the log of UAV 2")
        before = steps()
        wait_until(lambda: all(steps()[i] > before[i] for i in (1, 3)), "control of the others")
        assert steps()[2] == before[2]
        assert "law.py:13: ValueError: asked to" in log.read_text()
        assert "Traceback" not in fleet.stop()[1]
    messages = [message for _, message in read_tlog(fleet.folder / "flight.tlog")]
    texts = {
        (m.get_srcSystem(), str(m.to_dict()["text"]))
        for m in messages
        if m.get_type() == "STATUSTEXT"
    }
    assert {uav for uav, text in texts if "law.py:Fragile" in text} == {2}
