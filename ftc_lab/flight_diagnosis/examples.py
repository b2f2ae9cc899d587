"""Flights of which is known what failed."""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ftc_lab.flight_diagnosis.decisions import Learnt, Watched, ratios_of, watch
from ftc_lab.flight_diagnosis.relations import SURFACES, Relations, Surface, relations_of
from gcs.results.logs.read import read_flight


class Example(NamedTuple):
    """A flight of which is known what failed.

    Attributes:
        name: Of its file.
        truth: What failed; None: nothing.
        onset_s: When; infinite if nothing did.
        relations: Of the flight.
        watched: Its relations.
    """

    name: str
    truth: Surface | None
    onset_s: float
    relations: Relations
    watched: Mapping[Surface, Watched]

    def ratio(self, known: Learnt, *, healthy: bool) -> float:
        """Return the largest ratio of evidence to threshold before, or after, the fault."""
        chosen = (self.relations.time_s < self.onset_s) == healthy
        found = ratios_of(self.watched, known).values()
        return max(float(one[chosen].max(initial=0.0)) for one in found)

    def largest(self, surface: Surface, *, healthy: bool) -> float:
        """Return the largest evidence before, or after, the fault; 0 without any."""
        chosen = (self.relations.time_s < self.onset_s) == healthy
        return float(self.watched[surface].evidence[chosen].max(initial=0.0))


def example_of(path: Path) -> Example:
    """Read a flight of ALFA: its name says what failed, its channel `fault` when."""
    flight = read_flight(path)
    relations = relations_of(flight)
    onset_s = np.inf
    if "fault" in flight and flight["fault"].values.any():
        onset_s = float(flight["fault"].time_s[np.argmax(flight["fault"].values != 0.0)])
    truth = next((one for one in SURFACES if one in path.name), None)
    return Example(path.name, truth, onset_s, relations, watch(relations))
