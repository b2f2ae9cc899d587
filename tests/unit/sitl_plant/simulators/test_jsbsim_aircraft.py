"""Aircraft of JSBSim: which can be flown, by what surfaces and thrust, and that flights repeat."""

import contextlib
import gc
import importlib
import math
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from jsbsim_aircraft import (
    AILERON,
    ELEVATOR,
    RUDDER,
    gain,
    needs_jsbsim,
    write_aircraft,
)

from gcs.scenario.aircraft_file import load_aircraft
from sitl_plant.airframe.rigid_body import R1
from sitl_plant.simulators import new_simulator
from sitl_plant.simulators.base import Motion, Simulator, SimulatorError
from sitl_plant.simulators.config import JsbSimPlant
from sitl_plant.vec3 import Vec3, mul

pytestmark = needs_jsbsim

REST: Vec3 = (0.0, 0.0, 0.0)
DEFLECTED: Vec3 = (0.02, -0.04, 0.03)


def loaded(aircraft: str | Path, altitude_m: float = 300.0, **keys: Any) -> Simulator:
    plant = JsbSimPlant.model_validate({"kind": "jsbsim", "aircraft": str(aircraft), **keys})
    return new_simulator(plant, altitude_m)


def at(V: float, altitude_m: float = 300.0, alpha: float = 0.03) -> Motion:
    velocity = (V * math.cos(alpha), 0.0, V * math.sin(alpha))
    return Motion((0.0, 0.0, -altitude_m), velocity, (0.0, alpha, 0.0), REST, REST)


def flown(simulator: Simulator, seconds: float, V: float, thrust: float) -> Motion:
    simulator.control(DEFLECTED, thrust)
    simulator.reset(at(V))
    for k in range(round(seconds * 1000)):
        delta = DEFLECTED if k % 400 < 200 else REST
        simulator.control(delta, thrust)
        simulator.advance(1e-3)
    return simulator.read()


@pytest.mark.parametrize(
    ("aircraft", "V", "thrust"),
    [("c172p", 55.0, "force"), ("c172p", 55.0, "engine"), ("pc7", 80.0, "engine")],
)
def test_a_flight_repeats_bit_for_bit(aircraft: str, V: float, thrust: str) -> None:
    first, second = (flown(loaded(aircraft, thrust=thrust), 3.0, V, 1500.0) for _ in range(2))
    assert first == second
    assert max(abs(rate) for rate in first.rates) > 0.01


def test_what_is_set_is_read() -> None:
    motion = Motion(
        (10.0, -20.0, -400.0), (55.0, 1.0, 2.0), (0.3, -0.2, 9.0), (0.1, 0.2, 0.3), REST
    )
    simulator = loaded("c172p")
    simulator.reset(motion)
    for name, value in motion._asdict().items():
        if name != "specific_force":
            assert getattr(simulator.read(), name) == pytest.approx(value, abs=1e-6), name


def test_positions_are_the_integral_of_the_velocity_over_ground() -> None:
    simulator = loaded("c172p")
    simulator.set_wind((5.0, 3.0, 0.0))
    simulator.control((0.05, -0.02, 0.02), 1000.0)
    simulator.reset(at(55.0))
    motions = [simulator.read()]
    for _ in range(2000):
        simulator.advance(1e-3)
        motions.append(simulator.read())
    over_ground = np.array([mul(R1(m.attitude), m.velocity) for m in motions])
    moved = np.subtract(motions[-1].position, motions[0].position)
    assert moved == pytest.approx((over_ground[1:] + over_ground[:-1]).sum(0) * 5e-4, abs=1e-3)
    assert abs(moved[1]) > 1.0


@pytest.mark.parametrize("aircraft", ["c172p", "pc7", "minisgs", "J3Cub"])
def test_positive_deflections_turn_against_their_axes(aircraft: str) -> None:
    simulator = loaded(aircraft)
    for i in range(3):
        rates = []
        for share in (0.3, 0.6):
            low, high = simulator.stops[i]
            delta = [0.0, 0.0, 0.0]
            delta[i] = low + share * (high - low)
            simulator.control((delta[0], delta[1], delta[2]), 0.0)
            simulator.reset(at(40.0))
            simulator.advance(5e-3)
            rates.append(simulator.read().rates[i])
        assert rates[1] < rates[0], i


def test_stops_are_those_of_its_file() -> None:
    """Of c172p.xml: aileron -20 to 15°, turned; elevator -28 to 23°; rudder ±16°."""
    expected = np.array([[-15.0, 20.0], [-28.0, 23.0], [-16.0, 16.0]])
    assert np.degrees(loaded("c172p").stops) == pytest.approx(expected, abs=0.1)


def test_thrust_acts_along_x_at_the_centre_of_gravity() -> None:
    simulator = loaded("c172p")
    read = []
    for thrust in (0.0, 2000.0):
        simulator.control(REST, thrust)
        simulator.reset(at(55.0, alpha=0.0))
        force = simulator.read().specific_force
        simulator.advance(1e-3)
        read.append((np.array(force), np.array(simulator.read().rates)))
    pushed = (read[1][0] - read[0][0]) * simulator.body.mass_kg
    assert pushed == pytest.approx(np.array([2000.0, 0.0, 0.0]), abs=0.1)
    assert read[1][1] == pytest.approx(read[0][1], abs=1e-9)


@pytest.mark.parametrize("wanted", [500.0, 1000.0, 1800.0])
def test_the_engine_makes_the_thrust_that_is_asked_for(wanted: float) -> None:
    """Settled, as it is at the start."""
    simulator = loaded("c172p", thrust="engine")
    gliding = []
    for thrust in (wanted, 1200.0):
        simulator.control(REST, thrust)
        simulator.reset(at(55.0))
        simulator.control(REST, thrust)
        simulator.reset(at(55.0))
        gliding.append(simulator.read().specific_force[0])
    difference = (gliding[0] - gliding[1]) * simulator.body.mass_kg
    assert difference == pytest.approx(wanted - 1200.0, abs=100.0)  # it blows at the fuselage, too


def test_wind_is_the_motion_of_the_air() -> None:
    still, windy = loaded("c172p"), loaded("c172p")
    wind = (10.0, -4.0, 1.0)
    windy.set_wind(wind)
    motion = Motion((0.0, 0.0, -300.0), (55.0, 0.0, 2.0), REST, REST, REST)
    still.reset(motion)
    velocity = (55.0 + wind[0], wind[1], 2.0 + wind[2])
    windy.reset(motion._replace(velocity=velocity))
    assert windy.read().velocity == pytest.approx(velocity)
    assert windy.read().specific_force == pytest.approx(still.read().specific_force, rel=1e-6)
    windy.set_wind(REST)
    windy.advance(1e-3)
    assert windy.read().specific_force != pytest.approx(still.read().specific_force, rel=1e-2)


def test_a_wrong_element_can_be_patched() -> None:
    """Of minisgs, whose wing is ten times too large for its span and chord."""
    bundled, patched = loaded("minisgs"), loaded("minisgs", patch={"metrics/wingarea": 4.223})
    assert bundled.body.wing_area_m2 == pytest.approx(10.0 * patched.body.wing_area_m2)
    area = patched.body.wing_span_m * patched.body.mean_chord_m
    assert patched.body.wing_area_m2 == pytest.approx(area, rel=0.1)


def test_a_file_is_an_aircraft_too_and_its_units_can_be_patched(tmp_path: Path) -> None:
    folder = write_aircraft(tmp_path, load_aircraft("aerosonde"))
    (folder / "written.xml").rename(folder / "mine.xml")
    patch = {"metrics/wingspan": 10.0, "metrics/wingspan/@unit": "FT"}
    assert loaded(folder / "mine.xml").body.wing_span_m == pytest.approx(2.8956)
    assert loaded(folder / "mine.xml", patch=patch).body.wing_span_m == pytest.approx(3.048)


def test_the_installed_aircraft_stays_as_it_is_and_nothing_is_left() -> None:
    jsbsim: Any = importlib.import_module("jsbsim")
    file = Path(jsbsim.__file__).parent / "aircraft" / "c172p" / "c172p.xml"
    before, left = file.read_bytes(), set(os.listdir(tempfile.gettempdir()))
    loaded("c172p", patch={"metrics/wingarea": 170.0})
    assert file.read_bytes() == before
    assert not [
        name
        for name in set(os.listdir(tempfile.gettempdir())) - left
        if name.startswith("ftc-sitl-")
    ]


def test_outputs_and_inputs_are_left_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = write_aircraft(tmp_path, load_aircraft("aerosonde"))
    file = folder / "written.xml"
    text = file.read_text().replace(
        "</fdm_config>",
        f'<output name="{tmp_path}/out.csv" type="CSV" rate="100"><rates>ON</rates></output>'
        '<input port="1139"/></fdm_config>',
    )
    file.write_text(text)
    monkeypatch.chdir(tmp_path)
    loaded(folder).advance(0.1)
    assert not list(tmp_path.glob("**/*.csv"))
    assert file.read_text() == text


def test_a_file_of_engines_is_replaced_too(tmp_path: Path) -> None:
    folder = write_aircraft(tmp_path, load_aircraft("aerosonde"))
    file = folder / "written.xml"
    file.write_text(file.read_text().replace("<propulsion/>", '<propulsion file="engines"/>'))
    (folder / "engines.xml").write_text('<propulsion><engine file="not_there"/></propulsion>')
    assert loaded(folder).body.mass_kg == pytest.approx(11.0)


LAGGED = (
    '<lag_filter name="fcs/lagged"><input>fcs/rudder-cmd-norm</input><c1>5.0</c1>'
    f"<output>{RUDDER}</output></lag_filter>"
)
DAMPED = (
    '<summer name="fcs/damped"><input>fcs/rudder-cmd-norm</input>'
    f"<input>velocities/r-rad_sec</input><output>{RUDDER}</output></summer>"
)
FOLDED = (
    '<fcs_function name="fcs/folded"><function><abs><property>fcs/rudder-cmd-norm</property></abs>'
    f"</function><output>{RUDDER}</output></fcs_function>"
)


@pytest.mark.parametrize(
    ("rudder", "reason"),
    [
        (LAGGED, "the rudder follows fcs/rudder-cmd-norm late, by a servo of its own"),
        (DAMPED, "the rudder moves without fcs/rudder-cmd-norm, by an autopilot of its own"),
        (FOLDED, "has no inverse"),
    ],
)
def test_a_flight_control_of_its_own_is_refused(tmp_path: Path, rudder: str, reason: str) -> None:
    others = gain("aileron", AILERON, 0.4) + gain("elevator", ELEVATOR, 0.4)
    folder = write_aircraft(tmp_path, load_aircraft("aerosonde"), control=others + rudder)
    with pytest.raises(SimulatorError, match=reason):
        loaded(folder)


def test_without_a_rudder_its_stops_are_0(tmp_path: Path) -> None:
    others = gain("aileron", AILERON, -0.4) + gain("elevator", ELEVATOR, 0.3)
    folder = write_aircraft(tmp_path, load_aircraft("aerosonde"), control=others)
    expected = np.array([[-0.4, 0.4], [-0.3, 0.3], [0.0, 0.0]])
    assert loaded(folder).stops == pytest.approx(expected)


@pytest.mark.parametrize(
    ("keys", "reason", "hint"),
    [
        (
            {"aircraft": "nothing"},
            "expected one that comes with JSBSim, got 'nothing'",
            "./nothing",
        ),
        ({"aircraft": "./nothing"}, "expected a folder NAME with NAME.xml in it, or the", ""),
        ({"aircraft": "/usr"}, "expected a folder NAME with NAME.xml in it, or the", ""),
        ({"aircraft": "none.xml"}, "expected a folder NAME with NAME.xml in it, or the", ""),
        ({"aircraft": "T38"}, "fcs/throttle-cmd-norm does not exist", "plant.thrust: engine"),
        ({"aircraft": "Camel"}, "fcs/mixture-cmd-norm does not exist", "plant.thrust: engine"),
        ({"aircraft": "f16", "thrust": "engine"}, "has no inverse", "flight control of its own"),
        ({"aircraft": "SGS", "thrust": "engine"}, "has no engine", "plant.thrust: force"),
        ({"aircraft": "ball"}, "JSBSim's ball has no aerodynamic surfaces", ""),
        ({"patch": {"metrics/wings": 1.0}}, "'metrics/wings', which is the path of 0", "wingarea"),
        ({"patch": {"metrics/[": 1.0}}, "the path of 0", ""),
        ({"patch": {"metrics/wingspan": 0.0}}, "wing_span_m is 0.0, expected > 0", ""),
    ],
)
def test_what_cannot_be_flown_is_refused(keys: dict[str, Any], reason: str, hint: str) -> None:
    with pytest.raises(SimulatorError) as refused:
        loaded(**{"aircraft": "c172p", **keys})
    assert reason in str(refused.value)
    assert hint in refused.value.hint


def test_the_page_names_all_that_can_be_flown() -> None:
    """Of what comes with the version that requirements.txt has."""
    page = (Path(__file__).parents[4] / "docs" / "how-to" / "jsbsim.md").read_text()
    sentence = page[page.index("these can be flown with `thrust: force`:") :].partition(". ")[0]
    named = set(re.findall(r"`([^`: ]+)`", sentence))
    jsbsim: Any = importlib.import_module("jsbsim")
    folder = Path(jsbsim.__file__).parent / "aircraft"
    flown = set()
    for aircraft in (path.name for path in folder.iterdir() if path.is_dir()):
        with contextlib.suppress(SimulatorError):
            loaded(aircraft)
            flown.add(aircraft)
    assert named == flown


@pytest.mark.parametrize(
    ("text", "reason"),
    [("<fdm_config>", "not XML"), ("<x/>", "expected an aircraft, <fdm_config>")],
)
def test_a_file_that_is_no_aircraft_is_refused(tmp_path: Path, text: str, reason: str) -> None:
    folder = write_aircraft(tmp_path, load_aircraft("aerosonde"))
    (folder / "written.xml").write_text(text)
    with pytest.raises(SimulatorError, match=reason):
        loaded(folder)


def test_an_aircraft_that_misses_a_property_does_not_end_the_process() -> None:
    """The destructor of JSBSim would, after such an error."""
    code = (
        "import gc\n"
        "from sitl_plant.simulators.config import JsbSimPlant\n"
        "from sitl_plant.simulators import new_simulator\n"
        "from sitl_plant.simulators.base import SimulatorError\n"
        "try:\n    new_simulator(JsbSimPlant(kind='jsbsim', aircraft='Camel'), 300.0)\n"
        "except SimulatorError: pass\n"
        "gc.collect()\nprint('alive')\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=600, check=False
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "alive\n", "")
    gc.collect()


def test_without_the_package_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "jsbsim", None)
    monkeypatch.delitem(sys.modules, "sitl_plant.simulators.jsbsim", raising=False)
    with pytest.raises(SimulatorError, match="jsbsim is not installed here") as missing:
        loaded("c172p")
    assert missing.value.hint == "pip install 'jsbsim>=1.3.3'"
