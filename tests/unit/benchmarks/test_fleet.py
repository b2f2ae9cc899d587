"""The fleets of the benchmarks are scenarios that can be written and read."""

from pathlib import Path

from benchmarks.fleet import star
from gcs.scenario.model import load_scenario
from mavlink_defs.config.yaml_text import yaml_of


def test_a_fleet_of_any_size_is_a_scenario(tmp_path: Path) -> None:
    file = tmp_path / "star.yaml"
    for uavs in (1, 4, 30):
        file.write_text(yaml_of(star(uavs, 0.5)))
        assert len(load_scenario(file).uavs) == uavs
