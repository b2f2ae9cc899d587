"""Text of others enters by many doors; at none of them does a control character come through.

Text of the wire, of files, of names and of the command line is sent in with every control, format,
surrogate and separator character that the door can carry, and what people see is searched.
"""

import json
import sys
import unicodedata
from itertools import product
from pathlib import Path
from typing import Any

import pytest
from lossy_network import GCS, VEHICLE, over_the_wire
from typer.testing import CliRunner

from ftc_autopilot import autopilot, process
from ftc_lab.campaigns.gate import Check
from ftc_lab.reports.gate import gate_markdown, junit
from ftc_lab.reports.markdown import html_of, save_markdown
from gcs.commands import cli
from gcs.commands.wire import _named_port
from gcs.console.errors import BadInput, CommandRefused
from gcs.scenario.model import scenario_of, scenario_tree
from gcs.scenario.profile_file import load_profile
from gcs.tui.playback import Playback
from gcs.tui.profile_views import ProfileFiles
from mavlink_defs import dialect
from mavlink_defs.config.models import ConfigError, Problem
from mavlink_defs.config.yaml_text import parse_yaml, yaml_of
from mavlink_defs.framing.frames import text_chunks
from mavlink_defs.services.param import ParamFinished, ParamReader
from mavlink_defs.services.statustext import TextAssembler
from sitl_plant.loop import process as plant_process

UNSEEN = {"Cc", "Cf", "Cs", "Zl", "Zp"}
EVERY = "".join(
    chr(i)
    for i in (*range(1, 0x20000), *range(0xE0000, 0xE1000))  # elsewhere are ideographs
    if unicodedata.category(chr(i)) in UNSEEN and not 0xD802 <= i < 0xDC7F
)
ENCODED = "".join(c for c in EVERY if unicodedata.category(c) != "Cs")
ON_THE_WIRE = [bytes(range(1, 16)), bytes(range(16, 32)), b"\x1b]0;PWN\x07\x7f\r\n"]
PATH = "\x1b]0;PWN\x07\x9b2J\u202e\u2028\n\r\x7f\udcff.yaml"
HOME = str(Path.home())
SCENARIO_1 = str(Path(__file__).parents[3] / "scenarios" / "paper" / "scenario1.yaml")


def assert_visible(text: str, lines: bool = True) -> None:
    """No character of the text acts on a terminal, line feeds apart if it has lines."""
    assert text
    raw = {c for c in text if unicodedata.category(c) in UNSEEN} - ({"\n"} if lines else set())
    assert not raw, [hex(ord(c)) for c in raw]


# the wire


@pytest.mark.parametrize("raw", ON_THE_WIRE)
def test_texts_of_vehicles(raw: bytes) -> None:
    chunks = [raw, b"b" * 50 + raw]
    for k, chunk in enumerate(chunks):
        message = dialect.MAVLink_statustext_message(4, chunk[:50], 7 * k, 0)
        assembler = TextAssembler()
        heard: Any = over_the_wire(message, VEHICLE)
        texts = assembler.receive(heard, 0.0) or assembler.handle_timer(9.0)
        assert_visible(texts[0].text, lines=False)


@pytest.mark.parametrize("raw", ON_THE_WIRE)
def test_texts_and_names_in_a_log(raw: bytes) -> None:
    sender = dialect.MAVLink(None, *VEHICLE)
    alive = dialect.MAVLink_heartbeat_message(1, 3, 0, 0, 4, 3)
    said = dialect.MAVLink_statustext_message(4, raw)
    frames = [bytes(message.pack(sender)) for message in (alive, said)]
    playback = Playback("log", [(k * 1000, frame) for k, frame in enumerate(frames)], lambda: 0.0)
    playback.seek(1.0)
    while playback.is_seeking:
        playback.advance()
    texts = [entry.text for entry in playback.event_log.entries]
    assert any("\\x" in text for text in texts)
    for text in texts:
        assert_visible(text, lines=False)


@pytest.mark.parametrize("raw", ON_THE_WIRE)
def test_names_of_parameters(raw: bytes) -> None:
    value = dialect.MAVLink_param_value_message(raw, 1.0, 9, 1, 0)
    heard: Any = over_the_wire(value, VEHICLE)
    reader = ParamReader(GCS, VEHICLE, heard.param_id)
    reader.start(0.0)
    reader.receive(heard, 0.1)
    finished = [e for e in reader.events() if isinstance(e, ParamFinished)]
    assert_visible(finished[0].params[0].name, lines=False)


@pytest.mark.parametrize("text", [EVERY, "\x1b[31mX\x07 is not known"])
def test_what_a_vehicle_echoes(text: str) -> None:
    for message in text_chunks(4, text, 1):
        heard: Any = over_the_wire(message, VEHICLE)
        assert_visible(heard.text or "empty", lines=False)


# names and files


def test_names_of_scenarios(tmp_path: Path) -> None:
    tree = scenario_tree(SCENARIO_1)
    uavs = [{**uav, "name": f"{ENCODED}{uav['id']}"} for uav in tree["uavs"]]
    scenario = scenario_of(
        tmp_path, {**tree, "name": ENCODED, "description": ENCODED, "uavs": uavs}
    )
    assert_visible(scenario.name, lines=False)
    assert_visible(scenario.uavs[0].name, lines=False)
    assert_visible(scenario.description)


def test_configurations_that_are_written() -> None:
    tree = {"name": ENCODED, ENCODED: ["a text \u202e"]}
    text = yaml_of(tree)
    assert_visible(text)
    assert parse_yaml(text) == tree


def test_names_and_descriptions_of_profiles(tmp_path: Path) -> None:
    file = tmp_path / PATH
    file.write_text(json.dumps({"name": ENCODED, "profile": [{"start_s": EVERY}], EVERY: 1}))
    with pytest.raises(ConfigError) as refused:
        load_profile(file)
    assert_visible(str(refused.value))
    for problem in refused.value.problems:
        assert_visible(str(problem), lines=False)
    files = ProfileFiles.__new__(ProfileFiles)  # one that is made watches its folder
    assert_visible(files.process_label(file.name).plain, lines=False)


def test_errors() -> None:
    assert_visible(str(BadInput(EVERY)))
    assert_visible(str(CommandRefused(EVERY, 1)))
    assert_visible(str(ConfigError(PATH, [Problem((EVERY, 1), EVERY)])))


READING = [
    ("fly",),
    ("sweep",),
    ("campaign",),
    ("mission", "show"),
    ("profile", "check"),
    ("log",),
    ("wire",),
    ("compare", "runs"),
    ("export",),
    ("fly", SCENARIO_1, "--with"),
    ("mission", "show", SCENARIO_1, "--fleet"),
]
CONTENTS = [None, EVERY, json.dumps({"name": EVERY, EVERY: [EVERY]})]
SUFFIXES = [".yaml", ".plan", ".waypoints", ".tlog", ".pcap"]


def test_files_on_the_command_line(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    subtests: pytest.Subtests,
) -> None:
    for command, content, suffix in product(READING, CONTENTS, SUFFIXES):
        with subtests.test(" ".join(command), content=CONTENTS.index(content), suffix=suffix):
            file = tmp_path / PATH.replace(".yaml", suffix)
            file.unlink(missing_ok=True)
            if content is not None:
                file.write_bytes(content.encode(errors="surrogatepass"))
            monkeypatch.setattr(sys, "argv", ["gcs", *command, str(file)])
            with pytest.raises(SystemExit):
                cli.main()
            captured = capsys.readouterr()
            assert_visible(captured.out + captured.err)


@pytest.mark.parametrize(
    "arguments",
    [
        (PATH,),
        ("fly", f"--{PATH}"),
        ("fly", SCENARIO_1, "--set", f"name{PATH}=1"),
        ("fly", SCENARIO_1, "--speed", PATH),
        ("sweep", SCENARIO_1, "--set", f"trigger.mode={PATH}"),
        ("param", "get", PATH, "--connect", PATH),
        ("fault", "set", PATH),
        ("mode", PATH),
        ("wire", "--relay", PATH),
        ("wire", "--relay", "127.0.0.1:1=127.0.0.1:2", "--impair", PATH),
        ("key", f"/nowhere/{PATH}"),
        ("new", f"/nowhere/{PATH}"),
        ("campaign", "campaigns/faults", "--until", PATH),
    ],
)
def test_arguments_on_the_command_line(
    arguments: tuple[str, ...],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(sys, "argv", ["gcs", *arguments])
    with pytest.raises(SystemExit):
        cli.main()
    captured = capsys.readouterr()
    assert_visible(captured.out + captured.err)


def test_a_flight_in_a_folder_with_any_name(tmp_path: Path) -> None:
    file = tmp_path / PATH
    tree = {"extends": SCENARIO_1, "name": ENCODED, "duration_s": 0.02, "faults": []}
    file.write_text(yaml_of(tree))
    out = tmp_path / PATH.removesuffix(".yaml")
    done = CliRunner().invoke(cli.app, ["fly", str(file), "--in-process", "--out", str(out)])
    assert done.exit_code == 0, str(done.exception)
    assert_visible(done.output)
    assert_visible((out / "summary.json").read_text())


# logs and reports


@pytest.mark.parametrize("main", [process.main, plant_process.main])
def test_logs_of_processes(
    main: object, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / PATH
    file.write_text(json.dumps({EVERY: EVERY, "name": EVERY, "bind": EVERY}))
    with pytest.raises(SystemExit):
        main([str(file)])  # type: ignore[operator]  # both are functions of arguments
    autopilot.log(1, EVERY)
    assert_visible(capsys.readouterr().err)


def test_reports(tmp_path: Path) -> None:
    markdown = f"# {EVERY}\n\n| {EVERY} |\n"
    save_markdown(tmp_path / "report.md", markdown)
    assert_visible((tmp_path / "report.md").read_text())
    assert_visible(html_of(markdown, tmp_path))
    checks = [Check(EVERY, EVERY, violated=True, text=EVERY)]
    assert_visible(junit(EVERY, EVERY, checks, [EVERY]))
    save_markdown(tmp_path / "gate.md", gate_markdown(EVERY, EVERY, checks, [EVERY]))
    assert_visible((tmp_path / "gate.md").read_text())


@pytest.mark.parametrize("main", [process.main, plant_process.main])
def test_arguments_of_processes(main: object, capsys: pytest.CaptureFixture[str]) -> None:
    for arguments in ([PATH, f"--{PATH}"], [PATH, "--exit-with-parent", PATH]):
        with pytest.raises(SystemExit):
            main(arguments)  # type: ignore[operator]  # both are functions of arguments
        assert_visible(capsys.readouterr().err)


def test_names_of_links() -> None:
    assert_visible(_named_port(f"{EVERY}=14560")[1], lines=False)


# reports of tests

IN_TESTS = """
import pytest

from gcs.console.errors import GcsError

NASTY, PATH = {nasty}, {path}

@pytest.mark.ftc_scenario(PATH)
def test_of_no_file(ftc_fleet):
    pass

@pytest.mark.ftc_scenario("my.yaml", **{{NASTY: NASTY}})
def test_of_no_key(ftc_flight):
    pass

@pytest.mark.ftc_scenario("my.yaml", trigger=NASTY)
def test_of_no_value(ftc_fleet):
    pass

@pytest.mark.ftc_scenario("my.yaml", mode="in_process")
def test_of_names(ftc_flight):
    assert ftc_flight.scenario.uavs == ftc_flight.scenario.name

@pytest.mark.ftc_scenario("my.yaml", mode="in_process")
def test_of_a_channel(ftc_flight):
    ftc_flight.uav(1).channels[NASTY]

@pytest.mark.ftc_scenario("my.yaml", mode=NASTY)
def test_of_a_mode(ftc_flight):
    pass

def test_of_a_call(ftc_fly):
    ftc_fly(PATH)

def test_of_a_fleet(ftc_launch):
    uav, said = ftc_launch("my.yaml").uav(1), []
    for ask in (uav.get_param, uav.set_mode, uav.set_fault, lambda text: uav.sent(text)):
        with pytest.raises(GcsError) as refused:
            ask(NASTY)
        said.append(str(refused.value))
    raise AssertionError("\\n".join(said))
"""


def test_reports_of_pytest(pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> None:
    tree = scenario_tree(SCENARIO_1)
    uavs = [{**uav, "name": f"{ENCODED}{uav['id']}"} for uav in tree["uavs"]]
    tree |= {"name": ENCODED, "description": ENCODED, "uavs": uavs, "duration_s": 0.02}
    (pytester.path / "my.yaml").write_text(yaml_of({**tree, "faults": []}))
    pytester.makepyfile(IN_TESTS.format(nasty=ascii(EVERY), path=ascii(PATH)))
    monkeypatch.setenv("HOME", HOME)  # pytester has another one, without compiled code
    options = ("-p", "no:cacheprovider", "--basetemp", pytester.path / PATH[:-5])
    done = pytester.runpytest_subprocess(*options)  # in this one it would unload modules of numba
    outcomes = done.parseoutcomes()
    assert sum(outcomes.values()) == outcomes["failed"] + outcomes["errors"] == 8
    assert "- ftc-sitl -" in done.stdout.str()
    assert_visible(done.stdout.str())
