"""What commands show of a fleet at 80 columns and in a pipe: nothing is cut, no number split."""

import shlex
from collections.abc import Iterator

import pytest
from flying import environment, run, scenario_tree
from printed import OF_A_FLEET, assert_same_numbers
from station import ALL, SOMEDAY, Up, up

pytestmark = pytest.mark.sitl


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Up]:
    """Three UAVs that wait with a profile and a fault of three actuators, and files beside them."""
    with up(tmp_path_factory.mktemp("fleet"), tree=scenario_tree(faults=[])) as fleet:
        for actuator in ("aileron", "elevator", "rudder"):
            values = ("--effectiveness", "0.12345", "--bias-deg", "-1.2345", *SOMEDAY)
            assert fleet.gcs("fault", "set", actuator, *ALL, *values).returncode == 0
        (fleet.folder.parent / "other.parm").write_text("TRIG_B1 0.0123456\nNO_SUCH_NAME 1\n")
        yield fleet


def shown(fleet: Up, command: str, columns: str) -> str:
    """What a command prints at a width; without one in a pipe."""
    env = environment(FTC_SITL_CONNECT=fleet.hub, COLUMNS=columns)
    if not columns:
        del env["COLUMNS"]
    arguments = shlex.split(f"{command} {OF_A_FLEET[command]}")
    done = run("gcs", *arguments, *ALL, env=env, cwd=fleet.folder.parent)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.parametrize("command", OF_A_FLEET)
def test_nothing_is_cut(fleet: Up, command: str) -> None:
    assert_same_numbers(command, shown(fleet, command, "80"), shown(fleet, command, ""))
