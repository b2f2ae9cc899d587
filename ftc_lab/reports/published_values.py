"""Values printed in the paper: Tables IV and V and the numbers on the bars of Fig. 9.

Airspeed IAE in m, angles in deg s; transmissions in 24 s of 24 000 control periods.
"""

TABLE_IV: dict[str, dict[str, float]] = {
    "scenario2_proposed": {"airspeed": 17.8, "roll": 16.4, "pitch": 13.4, "yaw": 25.6},
    "scenario2_periodic": {"airspeed": 15.8, "roll": 18.0, "pitch": 14.3, "yaw": 25.0},
    "scenario2_backstepping": {"airspeed": 88.5, "roll": 33.1, "pitch": 19.2, "yaw": 37.4},
}
"""IAE of follower 2 in scenario 2, by scenario file."""

_EVERY_PERIOD = {"throttle": 24000, "aileron": 24000, "elevator": 24000, "rudder": 24000}

TABLE_V: dict[str, dict[str, int]] = {
    "scenario2_proposed": {"throttle": 2146, "aileron": 5263, "elevator": 2810, "rudder": 2575},
    "scenario2_periodic": _EVERY_PERIOD,
    "scenario2_backstepping": _EVERY_PERIOD,
}
"""Transmissions of follower 2 in scenario 2, by scenario file."""

SAVING = 0.8667
"""Share of transmissions saved by the proposed controller, follower 2."""

FIG_9: dict[int, dict[str, int]] = {
    1: {"throttle": 1931, "aileron": 4482, "elevator": 2465, "rudder": 2489},
    2: {"throttle": 1397, "aileron": 4538, "elevator": 2586, "rudder": 2544},
    3: TABLE_V["scenario2_proposed"],
}
"""Events in scenario 1 by UAV; the figure does not say which bar of UAV 2 is which channel, and
its smallest number is taken for the throttle as with the other two."""
