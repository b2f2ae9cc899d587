"""From a law's command to the wire, whatever the trigger."""

from dataclasses import dataclass, field

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from steps import step_of

from ftc_autopilot.common.motion import motion_of
from ftc_autopilot.common.tuples import four
from ftc_autopilot.control.controller import new_controller, parameter_record
from ftc_autopilot.control.laws.proposed import Proposed
from ftc_autopilot.control.step import Command, Thresholds
from ftc_autopilot.control.transmit import transmit
from ftc_autopilot.control.triggers import MODES, TRIGGERS
from mavlink_defs.framing.codec import SIM_STATE

A, B = (0.01, 0.5), (0.01, 0.0175)
ALL = 0b1111
AILERON, RUDDER, THROTTLE = 1, 4, 8

surface = st.floats(-2.0, 2.0)
thrust = st.floats(-500.0, 3000.0)


_FLYING = np.zeros(1, SIM_STATE)[0]
_FLYING["velocity"] = (45.0, 0.0, 0.0)


@dataclass
class Sender:
    """A trigger of default parameters, and the wire behind it."""

    nominal: np.void
    mode: str = "per_channel"
    state: np.void = field(default_factory=new_controller)
    controls: np.ndarray = field(default_factory=lambda: np.zeros(16, np.float32))

    def __post_init__(self) -> None:
        self.motion = motion_of(_FLYING, self.nominal)
        self.parameters = parameter_record(Proposed(), TRIGGERS[self.mode](mode=self.mode))

    @property
    def held(self) -> np.ndarray:
        return np.asarray(self.state["held"])

    def step(
        self, *delta: float, T: float, first: bool = False, chosen: int = ALL, dt: float = 1e-3
    ) -> int:
        command = Command((delta[0], delta[1], delta[2]), T, chosen)
        now = step_of(self.motion, first, dt=dt, held=four(self.held), thresholds=Thresholds(A, B))
        records = (self.parameters, self.state, self.controls)
        return transmit(command, now, self.nominal, *records, 0)


@pytest.mark.parametrize("mode", MODES)
def test_the_first_command_is_always_sent(mode: str, nominal: np.void) -> None:
    assert Sender(nominal, mode).step(0.0, 0.0, 0.0, T=0.0, first=True, chosen=0) == ALL


def test_a_threshold_is_reached_at_equality(nominal: np.void) -> None:
    sender = Sender(nominal)
    sender.held[3] = 1000.0
    assert sender.step(0.0, 0.0, 0.0, T=1010.49) == 0
    assert sender.step(0.0, 0.0, 0.0, T=1010.5) == THROTTLE
    sender.held[3] = 1000.0
    assert sender.step(0.0, 0.0, 0.0, T=989.5) == THROTTLE


def test_per_channel_updates_only_what_fired(nominal: np.void) -> None:
    sender = Sender(nominal)
    assert sender.step(0.1, 0.0, 0.0, T=0.1) == AILERON
    assert sender.held[1] == sender.held[2] == sender.held[3] == 0.0
    assert sender.controls[0] != 0.0


def test_joint_updates_all_surfaces_but_not_the_throttle(nominal: np.void) -> None:
    sender = Sender(nominal, "joint")
    assert sender.step(0.1, 0.01, 0.01, T=0.1) == 0b0111
    assert sender.held[1] != 0.0
    assert sender.held[3] == 0.0
    assert sender.step(0.1, 0.01, 0.01, T=0.6) == THROTTLE


@given(delta=st.tuples(surface, surface, surface), T=thrust, chosen=st.integers(0, ALL))
def test_the_law_chooses_what_is_sent(
    delta: tuple[float, float, float], T: float, chosen: int, nominal: np.void
) -> None:
    sender = Sender(nominal, "consequence")
    sender.held[:] = sender.controls[:4] = np.nan
    assert sender.step(*delta, T=T, chosen=chosen) == chosen
    sent = [bool(chosen & (1 << i)) for i in range(4)]
    assert list(np.isfinite(sender.held)) == list(np.isfinite(sender.controls[:4])) == sent


@given(delta=st.tuples(surface, surface, surface), T=thrust)
def test_the_held_value_is_the_one_on_the_wire(
    delta: tuple[float, float, float],
    T: float,
    nominal: np.void,
) -> None:
    sender = Sender(nominal)
    sender.step(*delta, T=T, first=True)
    limits = np.array([*nominal["stops"][:, 1], nominal["thrust_limit"]])
    assert np.array_equal(sender.held, sender.controls[:4].astype(np.float64) * limits)
    assert np.all(np.abs(sender.controls) <= 1.0)
    assert sender.controls[3] >= 0.0


@given(delta=st.tuples(surface, surface, surface), T=thrust)
def test_what_was_just_sent_does_not_fire_again(
    delta: tuple[float, float, float],
    T: float,
    nominal: np.void,
) -> None:
    """Also at the stops: the command to a saturated actuator does not change."""
    sender = Sender(nominal)
    sender.step(*delta, T=T, first=True)
    assert sender.step(*delta, T=T) == 0


@pytest.mark.parametrize("mode", MODES)
@given(commands=st.lists(st.tuples(surface, surface, surface, thrust), min_size=1, max_size=20))
def test_an_event_is_a_change_of_the_value_on_the_wire(
    mode: str, commands: list[tuple[float, float, float, float]], nominal: np.void
) -> None:
    """Any sniffer can count events: exactly, or at least those that change a value."""
    sender = Sender(nominal, mode)
    for k, (da, de, dr, T) in enumerate(commands):
        before = sender.controls.copy()
        mask = sender.step(da, de, dr, T=T, first=k == 0)
        changed = sum(1 << i for i in range(4) if sender.controls[i] != before[i])
        assert changed & ~mask == 0
        if mode in {"per_channel", "dynamic", "periodic_event"} and k > 0:
            assert changed == mask
