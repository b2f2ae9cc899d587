"""Short campaigns, and flights of them that kill their process."""

import os
import signal
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from ftc_lab.campaigns.flights import Flights, Row
from ftc_lab.campaigns.model import Campaign
from ftc_lab.campaigns.plan import Plan, plan
from gcs.scenario.model import Scenario

SCENARIO_1 = Path(__file__).parents[2] / "scenarios" / "paper" / "scenario1.yaml"
MASS = {"uncertainty.mass": {"draw": {"kind": "uniform", "low": 0.8, "high": 1.2}}}


def campaign_tree(**changes: Any) -> dict[str, Any]:
    """A campaign of the paper's scenario 1, 10 ms of it, with top-level keys replaced."""
    tree: dict[str, Any] = {
        "name": "A short campaign",
        "scenario": "paper/scenario1",
        "seed": 7,
        "draws": 8,
        "factors": MASS,
        "variants": {"short": {"duration_s": 0.01}},
    }
    return tree | changes


def write_campaign(folder: Path, **changes: Any) -> Path:
    path = folder / "campaign.yaml"
    path.write_text(yaml.safe_dump(campaign_tree(**changes), sort_keys=False))
    return path


def planned(**changes: Any) -> Plan:
    return plan(Campaign.model_validate(campaign_tree(**changes)), Path("campaign.yaml"))


@dataclass(frozen=True)
class DeadlyFlights(Flights):
    """Flights of which some kill their process, the first few times or always.

    Attributes:
        deaths: How often, by row.
        notes: Folder in which each death leaves a file.
    """

    deaths: Mapping[int, int] | None = None
    notes: Path = Path()

    def scenario(self, row: Row) -> Scenario:
        for k in range((self.deaths or {}).get(row["row"], 0)):
            note = self.notes / f"{row['row']}-{k}"
            if not note.exists():
                note.touch()
                os.kill(os.getpid(), signal.SIGKILL)
        return super().scenario(row)


def deadly(plan: Plan, deaths: Mapping[int, int], notes: Path) -> DeadlyFlights:
    flights = plan.flights
    return DeadlyFlights(
        flights.campaign,
        flights.file,
        flights.trees,
        flights.filled,
        flights.schema,
        deaths,
        notes,
    )


def rows_by_number(table: Any, columns: Sequence[str] | None = None) -> dict[int, dict[str, Any]]:
    """Rows of results without their wall times, by number."""
    picked = table if columns is None else table.select(["row", *columns])
    rows = picked.to_pylist()
    return {row["row"]: {k: v for k, v in row.items() if k != "wall_s"} for row in rows}
