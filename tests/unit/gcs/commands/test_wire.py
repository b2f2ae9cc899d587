"""``gcs wire`` and ``gcs wireshark``: what they say of files and options, in this process."""

import csv
import io
import json
import sys
from pathlib import Path
from typing import Any

import pytest
from capture_writer import pcap, pcapng, udp_packet

from gcs.commands.cli import main
from gcs.commands.wireshark import lua_dissector
from mavlink_defs import dialect
from mavlink_defs.capture.tap import DEFAULT_PORTS
from mavlink_defs.framing.frames import FramePacker

OTHERS = Path(__file__).parents[3] / "data" / "others"
AUTOPILOT, PLANT = ("127.0.0.1", 40123), ("127.0.0.1", 14560)
RELAY = ["--relay", "127.0.0.1:9=127.0.0.1:8"]


@pytest.fixture
def gcs(monkeypatch, capsys):
    """Run a command line; its exit status, standard output and error."""

    def run(*arguments: str | Path) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["gcs", *map(str, arguments)])
        monkeypatch.setenv("COLUMNS", "200")
        with pytest.raises(SystemExit) as ended:
            main()
        out, err = capsys.readouterr()
        assert "defect" not in err
        return int(ended.value.code or 0), out, err

    return run


def actuators(step: int, aileron: float) -> bytes:
    controls = [aileron, 0.5, 0.5, 0.5, *[0.0] * 12]
    message = dialect.MAVLink_hil_actuator_controls_message(1000 * step, controls, 0, 0)
    return udp_packet(AUTOPILOT, PLANT, FramePacker(7, 1).pack(message))


def some_flight(path: Path, write: Any = pcap, keep: int | None = None) -> Path:
    """Eleven control periods, of which two have a message of UAV 7."""
    content = write([(100.0, actuators(0, 0.1)), (100.1, actuators(10, 0.2))], "ethernet")
    path.write_bytes(content[:keep])
    return path


@pytest.mark.parametrize("write", [pcap, pcapng])
def test_a_capture_is_counted_and_compared(gcs, tmp_path: Path, write) -> None:
    path = some_flight(tmp_path / "a.cap", write)
    status, out, err = gcs("wire", path, "--period-us", 1000, "--json")
    report = json.loads(out)
    (uav,) = report["uavs"]
    assert (status, err) == (0, "")
    assert {n: c["events"] for n, c in uav["channels"].items()} == {
        "aileron": 2,
        "elevator": 1,
        "rudder": 1,
        "throttle": 1,
    }
    assert (uav["link"], uav["system"], uav["periods"]) == ("plant", 7, 11)
    assert report["saving"] == pytest.approx(1 - 5 / 44)


def test_tables_are_for_people(gcs, tmp_path: Path) -> None:
    status, out, _ = gcs("wire", some_flight(tmp_path / "a.pcap"), "--period-us", 1000)
    assert status == 0
    for text in ("HIL_ACTUATOR_CONTROLS", "to plant", "aileron", "10 ms", "81.82 %", "88.64 %"):
        assert text in out


def test_csv_has_a_row_per_stream_channel_and_reason(gcs, tmp_path: Path) -> None:
    path, table = tmp_path / "a.pcap", tmp_path / "a.csv"
    gcs("wire", some_flight(path), "--period-us", 1000, "--csv", table)
    with table.open(newline="") as file:
        (aileron,) = [row for row in csv.DictReader(file) if row["name"] == "aileron"]
    assert (aileron["count"], aileron["periodic"]) == ("2", "11")
    noise = udp_packet(PLANT, AUTOPILOT, b"noise")
    path.write_bytes(pcap([(1.0, actuators(0, 0.1)), (2.0, noise)], "raw"))
    assert gcs("wire", path, "--csv", table)[0] == 0
    rows = list(csv.DictReader(io.StringIO(table.read_text())))
    kinds = [(row["kind"], row["name"], row["count"]) for row in rows]
    assert kinds == [
        ("message", "HIL_ACTUATOR_CONTROLS", "1"),
        *[("channel", name, "1") for name in ("aileron", "elevator", "rudder", "throttle")],
        ("dropped", "not MAVLink 2", "1"),
    ]


def test_links_get_names_by_port(gcs, tmp_path: Path) -> None:
    path = some_flight(tmp_path / "a.pcap")
    report = json.loads(gcs("wire", path, "--link", "sim=14560", "--json")[1])
    assert [link["link"] for link in report["links"]] == ["sim"]


def test_a_capture_cut_off_is_counted_as_far_as_it_goes(gcs, tmp_path: Path) -> None:
    status, out, err = gcs("wire", some_flight(tmp_path / "a.pcap", keep=-5), "--json")
    assert status == 0
    assert json.loads(out)["links"][0]["datagrams"] == 1
    assert err.count("\n") == 1
    assert "a.pcap: cut off at byte" in err


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        ([], "expected either a FILE or --relay"),
        (["a.pcap", *RELAY], "expected either a FILE or --relay"),
        (["nowhere.pcap"], "nowhere.pcap cannot be read"),
        (["text"], "text is no capture"),
        (["strange.json"], "strange.json is no capture"),
        (["damaged.json"], "damaged.json is no capture"),
        (["--relay", "here"], "expected LISTEN=TARGET"),
        (["--relay", "127.0.0.1:9=no.such.host.invalid:8"], "no.such.host.invalid"),
        ([*RELAY, "--impair", "loss=2"], "loss: expected [0, 1], got 2"),
        ([*RELAY, "--impair", "los=0.1"], "did you mean 'loss'?"),
        ([*RELAY, "--impair", "bursts={begin=0.1}"], "bursts.end: missing"),
        ([*RELAY, "--impair", "loss=]"], "not YAML"),
        (["a.pcap", "--impair", "loss=0.1"], "--impair is for relays"),
        (["a.pcap", "--link", "plant"], "expected NAME=PORT"),
        (["a.pcap", "--csv", "a.pcap/a.csv"], "--csv is a.pcap/a.csv, but a.pcap is a file"),
    ],
)
def test_bad_input_is_named(gcs, tmp_path, monkeypatch, arguments: list[str], reason: str) -> None:
    monkeypatch.chdir(tmp_path)
    some_flight(tmp_path / "a.pcap")
    (tmp_path / "text").write_text("neither this nor that")
    (tmp_path / "strange.json").write_text('{"links": []}')
    damaged = {"span_s": 1, "links": 3, "messages": [], "uavs": [], "saving": None}
    (tmp_path / "damaged.json").write_text(json.dumps(damaged))
    status, out, err = gcs("wire", *arguments)
    assert (status, out) == (2, "")
    assert reason in err


def test_a_capture_without_mavlink_says_so(gcs, tmp_path: Path) -> None:
    path = tmp_path / "a.pcap"
    path.write_bytes(pcap([(1.0, udp_packet(AUTOPILOT, ("1.2.3.4", 53), b"dns"))], "raw"))
    status, _, err = gcs("wire", path)
    assert (status, "no MAVLink 2 frame" in err) == (1, True)


def test_the_dissector_is_written_to_a_file_or_standard_output(gcs, tmp_path: Path) -> None:
    path = tmp_path / "ftc.lua"
    assert gcs("wireshark", "--out", path, "--port", 9000) == (0, "", "")
    status, out, _ = gcs("wireshark")
    assert status == 0
    assert path.read_text().splitlines()[:-1] == out.splitlines()[:-1]
    assert "FTC_SIM_STATE" in out
    assert path.read_text().endswith(',9000", mavlink_proto)\n')


def test_the_dissector_knows_the_default_ports() -> None:
    ranges = lua_dissector().rpartition('add("')[2].partition('"')[0].split(",")
    ports = set()
    for text in ranges:
        first, _, last = text.partition("-")
        ports |= set(range(int(first), int(last or first) + 1))
    assert ports == set(DEFAULT_PORTS)


def test_messages_to_neighbours_stand_beside_the_events(gcs, tmp_path: Path) -> None:
    neighbour = dialect.MAVLink_ftc_neighbour_message(50.0, 0.0, (0.0,) * 3, (0.0,) * 3, 1)
    packet = udp_packet(AUTOPILOT, ("127.0.0.1", 14608), FramePacker(7, 1).pack(neighbour))
    path = tmp_path / "a.pcap"
    path.write_bytes(
        pcap([(100.0, actuators(0, 0.1)), (100.1, packet), (100.2, packet)], "ethernet")
    )
    _, out, _ = gcs("wire", path, "--period-us", 1000)
    (line,) = [line for line in out.splitlines() if "to neighbours" in line]
    assert "2" in line.split()


def test_packets_without_a_datagram_are_counted_by_what_they_are(gcs, tmp_path: Path) -> None:
    status, _, err = gcs("wire", OTHERS / "over_tcp.pcap")
    assert status == 1
    assert "over_tcp.pcap: 10 packets skipped that hold no UDP datagram over IPv4: 10 TCP" in err
    datagram = udp_packet(AUTOPILOT, ("1.2.3.4", 53), b"dns")

    def other(place: int, value: int) -> bytes:
        return datagram[:place] + bytes([value]) + datagram[place + 1 :]

    packets = [other(9, 6), other(9, 1), other(9, 1), other(9, 132), other(6, 0x20), other(0, 0x65)]
    path = tmp_path / "a.pcap"
    path.write_bytes(
        pcap([(1.0, actuators(0, 0.1)), *((2.0, packet) for packet in packets)], "raw")
    )
    status, _, err = gcs("wire", path)
    assert status == 0
    kinds = "2 ICMP, 1 IP protocol 132, 1 TCP, 1 fragments, 1 not IPv4"
    assert f"6 packets skipped that hold no UDP datagram over IPv4: {kinds}" in err
    path.write_bytes(path.read_bytes()[:-3])
    assert "cut off" in (text := gcs("wire", path)[2])
    assert "5 packets skipped" in text


def test_frames_of_mavlink_1_are_counted_as_such(gcs) -> None:
    status, out, _ = gcs("wire", OTHERS / "mavlink1.tlog", "--json")
    assert status == 1
    [link] = json.loads(out)["links"]
    assert (link["datagrams"], link["dropped"]) == (110, {"MAVLink 1": 110})
