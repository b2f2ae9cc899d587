"""The keys of every panel; keys of a single panel are in its class."""

from textual.binding import Binding

TABS = ("fleet", "plots", "faults", "profiles", "parameters", "events", "map")
"""The panels, in the order of their keys."""

ACTING = {"arm", "start", "mode", "disarm", "repeat", "clear_all"}
"""Actions that do something with vehicles: off in a log."""
REPLAYING = {"play", "seek", "speed"}
"""Actions that do something with a log."""

KEYS: list[Binding] = [
    *(
        Binding(str(i + 1), f"tab('{name}')", f"{name} panel", show=False)
        for i, name in enumerate(TABS)
    ),
    Binding("left_square_bracket", "select(-1)", "UAV before", show=False),
    Binding("right_square_bracket", "select(1)", "next UAV", show=False),
    Binding("asterisk", "mark_all", "mark all UAVs, or none", show=False),
    Binding("a", "arm", "arm", tooltip="Arm the marked UAVs, or the selected one"),
    Binding("s", "start", "start", tooltip="Start the mission"),
    Binding("m", "mode", "mode", tooltip="Change the mode"),
    Binding("x", "disarm", "disarm", tooltip="Disarm; by force in flight"),
    Binding(
        "r",
        "repeat",
        "repeat fault",
        show=False,
        tooltip="Give the last fault to the next UAV that does not have it",
    ),
    Binding(
        "C",
        "clear_all",
        "clear all faults",
        show=False,
        tooltip="Clear all faults of the marked UAVs, or of all",
    ),
    Binding("k", "play", "play/pause", show=False, tooltip="Log: play or pause"),
    Binding("j", "seek(-5)", "-5 s", show=False, tooltip="Log: 5 s back"),
    Binding("l", "seek(5)", "+5 s", show=False, tooltip="Log: 5 s on"),
    Binding("J", "seek(-60)", "-60 s", show=False, tooltip="Log: a minute back"),
    Binding("L", "seek(60)", "+60 s", show=False, tooltip="Log: a minute on"),
    Binding("less_than_sign", "speed(-1)", "slower", show=False, tooltip="Log: slower"),
    Binding("greater_than_sign", "speed(1)", "faster", show=False, tooltip="Log: faster"),
    Binding("t", "theme", "dark or light colours", show=False),
    Binding("question_mark,f1", "help", "help", tooltip="This help"),
    Binding("q", "quit", "quit", tooltip="Leave; the fleet flies on"),
]
