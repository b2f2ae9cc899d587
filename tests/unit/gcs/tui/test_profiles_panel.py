"""The profiles panel: which files can be opened."""

import re
from pathlib import Path

import pytest
from textual.pilot import Pilot
from textual.widgets.directory_tree import DirEntry
from textual.widgets.tree import TreeNode
from tui_bench import at_screen, playback
from waiting import until

from gcs.scenario.profile_file import load_profile
from gcs.tui.app import Dashboard
from gcs.tui.profile_views import ProfileFiles, ProfilePlot
from gcs.tui.profiles import ProfilesPanel


def test_a_bundled_profile_is_opened_by_its_name_from_any_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)

    async def work(app: Dashboard, pilot: Pilot[None]) -> None:
        await pilot.press("4", "o", *"profiles/ramps", "enter")
        panel = app.query_one(ProfilesPanel)
        for _ in range(200):
            if panel.segments is not None:
                break
            await pilot.pause(0.01)
        assert panel.segments == load_profile("profiles/ramps")

    at_screen(playback(), work)


@pytest.mark.parametrize("end_s", [15.0, 40.0])
def test_a_plot_has_round_ticks(end_s: float, tmp_path: Path) -> None:
    rest = "roll_deg: 0, pitch_deg: 5, yaw_deg: 0"
    first, second = f"airspeed_m_s: 41.7, {rest}", f"airspeed_m_s: 40, {rest}"
    file = tmp_path / "profile.yaml"
    file.write_text(f"profile: [{{start_s: 0, {first}}}, {{start_s: {end_s}, {second}}}]")

    async def work(app: Dashboard, pilot: Pilot[None]) -> None:
        await pilot.press("4")
        panel = app.query_one(ProfilesPanel)
        panel.load(file)
        await until(pilot, lambda: panel.segments is not None, "it is loaded")
        plt = app.query_one(ProfilePlot).plt
        plt.plotsize(60, 12)
        *lines, times = re.sub(r"\x1b\[[0-9;]*m", "", plt.build()).rstrip().splitlines()
        heights = [line.partition("┤")[0] for line in lines if "┤" in line]
        shown = [float(text) for text in (*times.split(), *heights)]
        assert len(shown) >= 8
        assert all(number % 5.0 == 0.0 for number in shown), shown

    at_screen(playback(), work)


def test_bundled_profiles_are_in_the_tree(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "own.yaml").write_text("profile: []")
    monkeypatch.chdir(tmp_path)

    async def work(app: Dashboard, pilot: Pilot[None]) -> None:
        panel, files = app.query_one(ProfilesPanel), app.query_one(ProfileFiles)

        def lines(node: TreeNode[DirEntry]) -> list[str]:
            below = [line for child in node.children for line in lines(child)]
            return [str(node.label), *(below if node.is_expanded else [])]

        async def choose(label: str) -> None:
            def at() -> bool:
                return files.cursor_node is not None and str(files.cursor_node.label) == label

            await until(pilot, lambda: label in lines(files.root), label)
            await pilot.press("home")
            for _ in lines(files.root):
                if at():
                    break
                await pilot.press("down")
            await until(pilot, at, label)
            await pilot.press("enter")

        await pilot.press("4")
        await until(pilot, lambda: "own.yaml" in lines(files.root), "the working folder")
        assert lines(files.root)[1:] == [tmp_path.name, "own.yaml", "bundled"]
        await choose("bundled")
        await choose("profiles")
        await choose("ramps.yaml")
        await until(pilot, lambda: panel.segments is not None)
        assert panel.segments == load_profile("profiles/ramps")
        assert "realistic.yaml" not in lines(files.root)

    at_screen(playback(), work)
