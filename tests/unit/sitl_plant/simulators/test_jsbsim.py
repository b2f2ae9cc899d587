"""JSBSim as a simulator, against what JSBSim itself says of forces and moments."""

from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sitl_plant.simulators.base import Motion
from sitl_plant.simulators.jsbsim import JsbsimSimulator, SimulatorError

pytest.importorskip("jsbsim", reason="jsbsim is missing: pip install jsbsim")

REST = (0.0, 0.0, 0.0)
FOOT, POUND = 0.3048, 4.4482216152605


def flying(name: str, V: float, delta: tuple[float, float, float], thrust: float = 0.0) -> Any:
    simulator = JsbsimSimulator(name, 1000.0)
    simulator.control(delta, thrust)
    simulator.reset(Motion((0.0, 0.0, -1000.0), (V, 0.0, 0.0), REST, REST, REST))
    simulator.control(delta, thrust)
    return simulator


@pytest.mark.parametrize(("name", "V"), [("c172p", 55.0), ("minisgs", 18.0), ("pc7", 80.0)])
def test_inertia_and_rates_make_jsbsim_s_own_moment(name: str, V: float) -> None:
    """J ω̇ + ω × J ω, with every element of J and its sign, while it rolls and pitches."""
    simulator = flying(name, V, (0.15, 0.05, 0.1))
    simulator.advance(0.06)
    before = np.array(simulator.read().rates)
    fdm = simulator._fdm
    moment = np.array([fdm[f"moments/{axis}-total-lbsft"] for axis in "lmn"]) * POUND * FOOT
    simulator.advance(1e-3)
    after = np.array(simulator.read().rates)
    J = simulator.body.inertia_kg_m2
    inertia = np.array([[J.Jxx, 0.0, -J.Jxz], [0.0, J.Jyy, 0.0], [-J.Jxz, 0.0, J.Jzz]])
    omega = (before + after) / 2.0
    made = inertia @ (after - before) / 1e-3 + np.cross(omega, inertia @ omega)
    assert made == pytest.approx(moment, abs=0.02 * float(np.linalg.norm(moment)))
    assert made[2] == pytest.approx(moment[2], abs=0.03 * abs(moment[2]))


@pytest.mark.parametrize("name", ["c172p", "pc7"])
def test_positive_deflections_turn_against_their_axes(name: str) -> None:
    for i in range(3):
        rates = []
        for angle in (-0.05, 0.05):
            delta = [0.0, 0.0, 0.0]
            delta[i] = angle
            simulator = flying(name, 60.0, (delta[0], delta[1], delta[2]))
            simulator.advance(0.02)
            rates.append(simulator.read().rates[i])
        assert rates[1] < rates[0]


def test_stops_are_the_flight_control_s() -> None:
    """Of c172p.xml: aileron -20 to 15°, turned; elevator -28 to 23°; rudder ±16°."""
    stops = np.degrees(JsbsimSimulator("c172p").stops)
    assert stops == pytest.approx(np.array([[-15, 20], [-28, 23], [-16, 16]]), abs=0.3)


def test_thrust_acts_along_x_and_turns_nothing() -> None:
    with_thrust, without = (flying("c172p", 55.0, REST, thrust) for thrust in (2000.0, 0.0))
    for simulator in (with_thrust, without):
        simulator.advance(5e-3)
    a, b = with_thrust.read(), without.read()
    expected = 2000.0 / with_thrust.body.mass_kg
    assert a.specific_force[0] - b.specific_force[0] == pytest.approx(expected, rel=0.02)
    assert np.subtract(a.rates, b.rates) == pytest.approx(np.zeros(3), abs=1e-4)


def test_wind_is_the_motion_of_the_air() -> None:
    still, windy = flying("c172p", 55.0, REST), JsbsimSimulator("c172p", 1000.0)
    windy.set_wind((10.0, 0.0, 0.0))
    windy.reset(Motion((0.0, 0.0, -1000.0), (65.0, 0.0, 0.0), REST, REST, REST))
    for simulator in (still, windy):
        simulator.advance(5e-3)
    assert windy.read().specific_force == pytest.approx(still.read().specific_force, abs=0.05)


@pytest.mark.parametrize(
    ("aircraft", "reason"),
    [("nothing", "no aircraft of JSBSim of that name"), ("f16", "without its engines")],
)
def test_what_it_cannot_fly_is_refused(aircraft: str, reason: str) -> None:
    with pytest.raises(SimulatorError, match=reason):
        JsbsimSimulator(aircraft)


def test_a_file_of_one_s_own_is_flown(tmp_path: Path) -> None:
    root = Path(import_module("jsbsim").get_default_root_dir())
    text = (root / "aircraft/minisgs/minisgs.xml").read_text()
    (tmp_path / "mine.xml").write_text(text)
    own = JsbsimSimulator(str(tmp_path / "mine.xml"), wing_area=0.3923)
    assert own.body.mass_kg == pytest.approx(JsbsimSimulator("minisgs").body.mass_kg)
    assert own.body.wing_area_m2 == pytest.approx(0.3923, rel=1e-4)
    (tmp_path / "bad.xml").write_text("<fdm_config>")
    with pytest.raises(SimulatorError, match="is not XML"):
        JsbsimSimulator(str(tmp_path / "bad.xml"))
