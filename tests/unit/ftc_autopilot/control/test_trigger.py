import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ftc_autopilot.control.trigger import CONSEQUENCE, JOINT, PER_CHANNEL, fires, trigger

A, B = (0.01, 0.5), (0.01, 0.0175)
ALL = 0b1111
AILERON, RUDDER, THROTTLE = 1, 4, 8

surface = st.floats(-2.0, 2.0)
thrust = st.floats(-500.0, 3000.0)


def new_actuators() -> tuple[np.ndarray, np.ndarray]:
    return np.zeros(4), np.zeros(16, np.float32)


def run(
    delta: tuple[float, float, float],
    T: float,
    held: np.ndarray,
    controls: np.ndarray,
    nominal: np.void,
    first: bool = False,
    mode: int = PER_CHANNEL,
    chosen: int = 0,
) -> int:
    return trigger(delta, T, held, first, mode, chosen, A, B, nominal, controls)


def test_the_first_command_is_always_sent(nominal: np.void) -> None:
    held, controls = new_actuators()
    assert run((0.0, 0.0, 0.0), 0.0, held, controls, nominal, first=True) == ALL


def test_a_threshold_is_reached_at_equality() -> None:
    assert fires(105.0, 100.0, 0.0, 5.0)
    assert not fires(104.999, 100.0, 0.0, 5.0)
    assert fires(-101.5, -100.0, 0.01, 0.5)


def test_per_channel_updates_only_what_fired(nominal: np.void) -> None:
    held, controls = new_actuators()
    assert run((0.1, 0.0, 0.0), 0.1, held, controls, nominal) == AILERON
    assert held[1] == held[2] == held[3] == 0.0
    assert controls[0] != 0.0


def test_joint_updates_all_surfaces_but_not_the_throttle(nominal: np.void) -> None:
    held, controls = new_actuators()
    assert run((0.1, 0.01, 0.01), 0.1, held, controls, nominal, mode=JOINT) == 0b0111
    assert held[1] != 0.0
    assert held[3] == 0.0


@given(delta=st.tuples(surface, surface, surface), T=thrust, chosen=st.integers(0, ALL))
def test_the_law_chooses_what_is_sent(
    delta: tuple[float, float, float], T: float, chosen: int, nominal: np.void
) -> None:
    held, controls = new_actuators()
    held[:] = controls[:4] = np.nan
    assert run(delta, T, held, controls, nominal, mode=CONSEQUENCE, chosen=chosen) == chosen
    sent = [bool(chosen & (1 << i)) for i in range(4)]
    assert list(np.isfinite(held)) == list(np.isfinite(controls[:4])) == sent


def test_the_first_command_of_a_choosing_law_is_sent_whole(nominal: np.void) -> None:
    held, controls = new_actuators()
    assert run((0.1, 0.0, 0.0), 1.0, held, controls, nominal, first=True, mode=CONSEQUENCE) == ALL


@given(delta=st.tuples(surface, surface, surface), T=thrust)
def test_the_held_value_is_the_one_on_the_wire(
    delta: tuple[float, float, float],
    T: float,
    nominal: np.void,
) -> None:
    held, controls = new_actuators()
    run(delta, T, held, controls, nominal, first=True)
    limits = np.array([nominal["surface_limit"]] * 3 + [nominal["thrust_limit"]])
    assert np.array_equal(held, controls[:4].astype(np.float64) * limits)
    assert np.all(np.abs(controls) <= 1.0)
    assert controls[3] >= 0.0


@given(delta=st.tuples(surface, surface, surface), T=thrust)
def test_what_was_just_sent_does_not_fire_again(
    delta: tuple[float, float, float],
    T: float,
    nominal: np.void,
) -> None:
    """Also at the stops: a saturated actuator has nothing new to be told."""
    held, controls = new_actuators()
    run(delta, T, held, controls, nominal, first=True)
    assert run(delta, T, held, controls, nominal) == 0


@pytest.mark.parametrize("mode", [PER_CHANNEL, JOINT])
@given(commands=st.lists(st.tuples(surface, surface, surface, thrust), min_size=1, max_size=20))
def test_an_event_is_a_change_of_the_value_on_the_wire(
    mode: int, commands: list[tuple[float, float, float, float]], nominal: np.void
) -> None:
    """Any sniffer can count events: per channel exactly, jointly for the group."""
    held, controls = new_actuators()
    for k, (da, de, dr, T) in enumerate(commands):
        before = controls.copy()
        mask = run((da, de, dr), T, held, controls, nominal, first=k == 0, mode=mode)
        changed = sum(1 << i for i in range(4) if controls[i] != before[i])
        assert changed & ~mask == 0
        if mode == PER_CHANNEL and k > 0:
            assert changed == mask
