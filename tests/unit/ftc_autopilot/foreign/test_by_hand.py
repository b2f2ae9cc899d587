"""What is said of an ArduPlane that somebody starts by hand."""

import shlex
from pathlib import Path
from typing import Any

import pytest

from ftc_autopilot.foreign.by_hand import instruction, waiting
from gcs.console.errors import BadInput
from gcs.fleet.foreign import check_foreign, to_start
from gcs.scenario.changes import with_changes
from gcs.scenario.model import Scenario


def scenario(**keys: Any) -> Scenario:
    values = {f"autopilot.{name}": value for name, value in ({"kind": "ardupilot"} | keys).items()}
    return with_changes("paper/scenario1", [], values, "--set")


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path / "ftc-sitl"


def options_of(line: str) -> dict[str, str]:
    words = shlex.split(line.partition("ArduPlane: arduplane ")[2])
    return dict(zip(words[::2], words[1::2], strict=True))


def test_each_has_a_line_with_ports_of_its_own(cache: Path) -> None:
    first, second, third = to_start(scenario())
    assert first.startswith("UAV 1 waits for an ArduPlane: arduplane -I 0 ")
    options = options_of(second)
    assert options == {
        "-I": "1",
        "--model": "JSON:127.0.0.1",
        "--sim-port-out": "9012",
        "--serial0": "udpclient:127.0.0.1:9013",
        "--sysid": "2",
        "--home": "-35.363262000,149.165237000,584.000,0",
        "--defaults": str(cache / "arduplane-9012.parm"),
    }
    assert "SIM_RATE_HZ" in Path(options["--defaults"]).read_text()
    assert options_of(third)["--sim-port-out"] == "9022"


def test_another_port_host_and_files_are_said(tmp_path: Path) -> None:
    own = tmp_path / "tuned by me.parm"
    config = scenario(port=20_000, defaults=str(own)).autopilot_config(3)
    config = config.model_copy(update={"formation_bind": "10.0.0.1:14603"})
    options = options_of(instruction(config))
    assert options["--model"] == "JSON:10.0.0.1"
    assert options["--serial0"] == "udpclient:10.0.0.1:20021"
    assert options["--defaults"].split(",")[1] == str(own)


def test_nobody_waits_for_a_program_that_the_bridge_starts(tmp_path: Path) -> None:
    flown = scenario(binary=str(tmp_path))
    assert waiting(flown.autopilot_config(1)) is None
    assert list(to_start(flown)) == []


def test_many_flights_have_nobody_who_starts_it() -> None:
    check_foreign(scenario(), over_udp=True, attended=True)
    with pytest.raises(BadInput, match=r"autopilot\.binary of UAV 1 is missing"):
        check_foreign(scenario(), over_udp=True)
