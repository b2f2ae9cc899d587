"""A fleet that waits for somebody's ground station."""

from pathlib import Path

from gcs.scenario.model import Scenario


class Standing:
    """Scenario, folder, port and system ids of the fleet."""

    def __init__(self, scenario: Scenario, folder: Path) -> None:
        self.scenario, self.folder = scenario, folder
        self.port = scenario.links.gcs_port
        self.ids = [uav.id for uav in scenario.uavs]
