"""A message of the telemetry is added in the files that the architecture page lists."""

from fnmatch import fnmatch
from pathlib import Path

from scratch_tree import ScratchTree, listed_files

EDITS = {
    "mavlink_defs/ftc.xml": [
        (
            '    <message id="53110" name="FTC_FLEET">',
            '    <message id="53112" name="FTC_ENERGY">\n'
            "      <description>Kinetic energy of the aircraft.</description>\n"
            '      <field type="uint32_t" name="time_boot_ms" units="ms">Simulation time.</field>\n'
            '      <field type="float" name="energy" units="J/kg">Energy per mass.</field>\n'
            "    </message>\n",
        )
    ],
    "ftc_autopilot/vehicle/controller_messages.py": [
        (
            "    @message(dialect.MAVLink_ftc_drops_message)",
            "    @message(dialect.MAVLink_ftc_energy_message)\n"
            "    def energy(self) -> MAVLink_message:\n"
            "        u, v, w = self._hot.measured['velocity'].tolist()\n"
            "        energy = 0.5 * (u * u + v * v + w * w)\n"
            "        return dialect.MAVLink_ftc_energy_message(self._hot.time_ms, energy)\n\n",
        )
    ],
    "gcs/tui/wire_panel.py": [
        ("from mavlink_defs.constants", "from mavlink_defs import dialect\n"),
        (
            '    title = "Wire"\n',
            "    known = [s.latest.get(dialect.MAVLINK_MSG_ID_FTC_ENERGY) for s in view.states]\n"
            "    parts = (f'{sum(m.energy for m in known if m):.0f} J/kg', *parts)\n",
        ),
    ],
}
USE = """
from ftc_autopilot.hot.hot_state import HotState
from ftc_autopilot.hot.state import new_autopilots
from ftc_autopilot.vehicle.vehicle import VehicleServices
from gcs.scenario.model import load_scenario
from gcs.station.telemetry import REQUESTED_S
from gcs.tui.wire_panel import WirePanel
from mavlink_defs.framing.frames import FramePacker, parse
from tui_bench import Station, at_screen, live

config = load_scenario("paper/scenario1").autopilot_config(1)
autopilots = new_autopilots([config])
hot = HotState(autopilots)
hot.measured["velocity"], hot.measured["time_usec"] = (40.0, 0.0, 0.0), 9_000_000
(telemetry,) = VehicleServices(config, hot, autopilots.controllers, 1.8e9).telemetry
for number, interval_s in REQUESTED_S.items():
    telemetry.set_interval((number, interval_s * 1e6))
station, packer = Station(1), FramePacker(1, 1)
for clock_us in (10_000_000, 10_020_000):
    for message in telemetry.due(clock_us):
        station.fleet.receive(parse(packer.pack(message)), station.time_s)

async def look(app, pilot):
    print(app.query_one(WirePanel).border_title)
    print(station.fleet.vehicles[1].time_s)

at_screen(live(station), look, (200, 50))
"""


def test_the_page_lists_the_files() -> None:
    listed = listed_files("a message")
    for file in EDITS:
        assert any(fnmatch(file, pattern) for pattern in listed)
    for pattern in listed:
        assert any(fnmatch(file, pattern) for file in EDITS)


def test_the_message_reaches_the_dashboard(tmp_path: Path) -> None:
    tree = ScratchTree(tmp_path, EDITS)
    title, time_s = tree.run("-c", USE).splitlines()
    assert title.startswith("Wire · 800 J/kg")
    assert float(time_s) == 9.0
