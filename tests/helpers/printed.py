"""How each command is made to print, for the tests of what people see in a terminal and a pipe."""

import re

SHORT = "--set duration_s=0.05"
BY_ITSELF = {
    "baseline": f"paper/scenario1 {SHORT} --tolerance 1000 --aircraft 2 --out OUT",
    "campaign": "campaign.yaml --jobs 1 --until 'p(success) > 0.1 at 90 %' --out OUT",
    "compare": "old new --fail-if 'p(success) < 0.01 at 90 %'",
    "compare ": "flights/one flights/two",
    "aircraft": "",
    "aircraft ": "aerosonde",
    "config": "paper/scenario1 --out OUT",
    "design": "aerosonde --law tube",
    "design ": "aerosonde --law tube --fly",
    "fly": f"paper/scenario1 {SHORT} --in-process --record none --out OUT",
    "fly ": f"missions/race_track {SHORT} --in-process --record none --out OUT",
    "fly  ": "--campaign old --row 0 --in-process --record none --out OUT",
    "guidance show": "path",
    "identify": "own:aerosonde --cruise 24",
    "laws show": "surviving",
    "log": "flight.tlog --list",
    "mission show": "missions/race_track",
    "profile check": "paper/scenario1",
    "runs list": ".",
    "runs list ": "flights --sort iae_yaw",
    "scenarios": "",
    "sweep": f"paper/scenario1 {SHORT} --set trigger.mode=per_channel,joint "
    "--set uncertainty.coefficients=0.8,1.2 --jobs 1 --out OUT",
    "triggers show": "dynamic",
    "trim": "paper/scenario1 --airspeed 50",
    "wire": "capture.pcap --period-us 1000",
}
"""Arguments of each command that needs no fleet; OUT is a new folder.

Blanks after a name tell several ways to call it apart.
"""

OF_A_FLEET = {
    "fault list": "",
    "formation show": "",
    "mission download": "",
    "param diff": "other.parm",
    "param list": "",
    "profile check": "scenario.yaml --held",
    "profile download": "",
    "status": "",
}
"""Arguments of each command that shows what a fleet of vehicles tells."""

NO_TABLE = {
    **dict.fromkeys(
        (
            *("arm", "disarm", "start", "mode"),
            *(
                "fault set",
                "fault clear",
                "fault sensor set",
                "fault sensor clear",
                "formation slot",
            ),
            *("mission fly", "mission upload", "profile upload"),
            *("param get", "param load", "param save", "param set"),
        ),
        "a line for each vehicle",
    ),
    **dict.fromkeys(
        ("export", "key", "new", "record", "runs html", "runs note"),
        "names the file it has written",
    ),
    **dict.fromkeys(("guidance header", "laws header", "triggers header"), "a program in C"),
    "diagnose": "ends with 1 if it finds something; its own tests look at the table",
    "estimate": "wants a log with sensors; its own tests look at the table",
    "replay-fault": "wants a flight that failed; its own tests look at the tables",
    "reproduce": "one sentence; its tables are in report.html",
    "up": "addresses, a line for each",
    "web": "an address",
    "wireshark": "a program in Lua",
}
"""Why each of the other commands has nothing that a narrow terminal could cut."""

FOLDED = {"baseline", "campaign", "fly", "mission show", "profile check", "status", "sweep", "trim"}
FOLDED |= {"runs list", "wire"}
"""Commands of which no line is longer than the terminal; others leave long lines to it."""

_OF_ITS_OWN_TIME = r"in \d+\.\d+ s( \([^)]*\))?|OUT\S*"


def numbers_in(text: str) -> list[str]:
    """Return all numbers of a text, and what hangs on to them, but for how long it took."""
    return sorted(re.findall(r"[^\s│]*\d[^\s│]*", re.sub(_OF_ITS_OWN_TIME, "", text)))


def assert_same_numbers(command: str, narrow: str, pipe: str) -> None:
    """Assert that a terminal of 80 columns shows what a pipe gets, with nothing cut or split."""
    assert pipe
    assert "…" not in narrow + pipe
    assert numbers_in(narrow) == numbers_in(pipe), narrow + pipe
    if command in FOLDED:
        assert max(map(len, narrow.splitlines())) <= 80
