"""Profile files: YAML with a `profile:` list, as in every scenario file, or mission files."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Annotated

import yaml
from pydantic import Field

from ftc_autopilot.guidance.mission_items import is_path
from ftc_autopilot.plugins.loading import without_code
from gcs.scenario.aircraft_file import with_named_files
from gcs.scenario.bundled import base_of, find_scenario
from gcs.scenario.model import Scenario, scenario_of
from gcs.scenario.sections import ProfileSegment
from mavlink_defs.config.files import validate
from mavlink_defs.config.inherit import read_inherited
from mavlink_defs.config.models import AtMost, ConfigError, Model, Problem, Prose, Title
from mavlink_defs.config.written import located
from mavlink_defs.mission_files import is_mission_file, read_mission_file
from mavlink_defs.profile import (
    ANY_AIRSPEED,
    MAX_SEGMENTS,
    ItemError,
    ProfileError,
    Segment,
    items_to_segments,
    segments_to_items,
)
from mavlink_defs.services.mission import MissionItem


class ProfileFile(Model):
    """A profile on its own.

    Attributes:
        name: Name of the profile.
        description: Purpose of the profile.
        profile: The segments, in order.
    """

    name: Title = ""
    description: Prose = ""
    profile: Annotated[tuple[ProfileSegment, ...], AtMost(MAX_SEGMENTS)] = Field(min_length=1)


def load_profile(name: Path | str) -> tuple[Segment, ...]:
    """Read the profile of a profile file, a mission file or a scenario, and check it.

    Airspeeds are checked against the aircraft's limits only in a scenario, which has them.

    Raises:
        ConfigError: The file cannot be used; it names every problem found.
    """
    path = find_scenario(name)
    if is_mission_file(path):
        return _segments_of(path, read_mission_file(path).items)
    with without_code():
        data = read_inherited(path, Scenario.model_fields.keys(), base_of, with_named_files)
        is_scenario = not data.keys() <= ProfileFile.model_fields.keys()
        scenario = scenario_of(path, data) if is_scenario else None
    if scenario is not None:
        segments = scenario.segments()
        if not segments:
            raise ConfigError(path, [Problem((), "has a mission, no profile; see gcs mission")])
        return segments
    file = validate(path, data, ProfileFile)
    segments = tuple(segment.segment() for segment in file.profile)
    try:
        return items_to_segments(segments_to_items(segments, 0, 0), ANY_AIRSPEED)
    except ItemError as error:
        problem = Problem(("profile", error.seq - 1), error.reason)
        raise ConfigError(path, located(data, [problem])) from error


def _segments_of(path: Path, items: Sequence[MissionItem]) -> tuple[Segment, ...]:
    """Return the profile that a mission file holds."""
    if is_path(items):
        text = "holds a path, not a profile; see `gcs mission upload`"
        raise ConfigError(path, [Problem((), text)])
    try:
        return items_to_segments(items, ANY_AIRSPEED)
    except ProfileError as error:
        raise ConfigError(path, [Problem((), str(error))]) from error


def profile_yaml(segments: Iterable[Segment]) -> str:
    """Return the text of a profile file with these segments."""
    lines = [
        yaml.safe_dump(segment.as_dict(), default_flow_style=True, sort_keys=False, width=1000)
        for segment in segments
    ]
    return "profile:\n" + "".join(f"  - {line}" for line in lines) if lines else "profile: []\n"
