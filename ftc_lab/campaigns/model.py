"""Campaign files: a base scenario, what is drawn, and how often.

Errors of a file are found as in a scenario, all at once; what needs the scenario
(keys, ranges) is checked by `ftc_lab.campaigns.plan`.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, StringConstraints, model_validator

from ftc_lab.campaigns.distributions import Choice, Distribution
from ftc_lab.campaigns.faults import AnyDrawnFault
from mavlink_defs.config.files import read, validate
from mavlink_defs.config.inherit import with_values
from mavlink_defs.config.models import (
    AtMost,
    ConfigError,
    Loc,
    Model,
    Problem,
    Problems,
    Prose,
    Title,
)
from mavlink_defs.config.quantity import quantity, whole
from mavlink_defs.visible import visible

NO_PROGRAMS: Mapping[str, str] = MappingProxyType({})
Design = Literal["grid", "random", "latin_hypercube", "sobol", "saltelli"]
Name = Annotated[str, StringConstraints(pattern=r"^[\w.\[\]-]+$")]
VariantName = Annotated[
    str, StringConstraints(pattern=r"^[^`|\x00-\x1f]+$"), AfterValidator(visible)
]


class Factor(Model):
    """One drawn value, laid over one key of the scenario.

    Attributes:
        key: Key of the scenario, as in trigger.b2_deg; the name by default.
        draw: Distribution of the value.
        relative: Multiply the scenario's value by the drawn one.
    """

    key: str | None = None
    draw: Distribution
    relative: bool = Field(default=False, strict=True)


class Kept(Model):
    """Flights whose trajectories are kept, in ``flights/ROW``; none of foreign autopilots.

    Attributes:
        worst: How many of the worst flights per figure.
        figures: Columns of the results, as in uav3.iae_roll; the largest is worst.
        failures: How many flights of each failed outcome.
        share: Random share of all flights.
    """

    worst: int = whole("", default=0, ge=0)
    figures: Annotated[tuple[str, ...], AtMost(1000)] = ()
    failures: int = whole("", default=0, ge=0)
    share: float = quantity("", default=0.0, ge=0.0, le=1.0)

    @model_validator(mode="after")
    def _worst_of_something(self) -> "Kept":
        if self.worst and not self.figures:
            raise Problems([(("figures",), "missing; expected columns of the results, with worst")])
        return self


class Campaign(Model):
    """Many flights of one scenario, with values drawn from distributions.

    Attributes:
        name: Name of the campaign.
        description: Purpose, in a line or more.
        scenario: The base: a file beside this one, or a bundled scenario.
        seed: Seed of every draw.
        draws: Draws, each flown by every variant; of saltelli, base points. Not of a grid.
        design: How values are drawn together; a grid takes every combination of choices.
        factors: Drawn values, by name.
        faults: Drawn faults, by name; one with `sensors` is of a sensor.
        variants: Changes of the scenario that fly the same draws, by name, as after `extends`.
        keep: Flights whose trajectories are kept.
    """

    name: Title = Field(min_length=1)
    description: Prose = ""
    scenario: str = Field(min_length=1)
    seed: int = whole("", default=1, ge=0, le=2**32 - 1)
    draws: int | None = whole("", default=None, ge=1, le=100_000_000)
    design: Design = "random"
    factors: Annotated[dict[Name, Factor], AtMost(1000)] = Field(default={})
    faults: Annotated[dict[Name, AnyDrawnFault], AtMost(1000)] = Field(default={})
    variants: Annotated[dict[VariantName, dict[str, Any]], AtMost(1000)] = Field(
        default={"base": {}}, min_length=1
    )
    keep: Kept = Kept()

    @property
    def drawn(self) -> dict[tuple[str, ...], Distribution]:
        """Every distribution of the campaign, by its place in the file."""
        found: dict[tuple[str, ...], Distribution] = {
            ("factors", name, "draw"): factor.draw for name, factor in self.factors.items()
        }
        for name, fault in self.faults.items():
            place = ("faults", name)
            found[*place, "start_s"] = fault.start_s
            if fault.lasts_s is not None:
                found[*place, "lasts_s"] = fault.lasts_s
            if fault.frequency_hz is not None:
                found[*place, "frequency_hz"] = fault.frequency_hz
            found |= {(*place, "kinds", kind): by for kind, by in fault.kinds.items() if by}
        return found

    @model_validator(mode="after")
    def _parts_fit_together(self) -> "Campaign":
        Problems.check(self._found())
        return self

    def _found(self) -> list[tuple[Loc, str]]:
        found: list[tuple[Loc, str]] = []
        if not self.factors and not self.faults and self.design != "grid":
            found.append((("factors",), "missing; expected factors or faults to draw"))
        if self.design == "grid":
            if self.draws is not None:
                found.append((("draws",), "a grid has as many as its choices combine to"))
            found += [
                (place, f"expected kind 'choice' in a grid, got {by.kind!r}")
                for place, by in self.drawn.items()
                if not isinstance(by, Choice)
            ]
        elif self.draws is None:
            found.append((("draws",), "missing; expected a whole number"))
        elif self.design in {"sobol", "saltelli"} and self.draws.bit_count() != 1:
            text = f"expected a power of two with {self.design}, got {self.draws}"
            found.append((("draws",), text))
        return found


def load_campaign(path: Path | str, draws: int | None = None) -> Campaign:
    """Read a campaign file and check what can be checked without its scenario.

    Args:
        path: The file.
        draws: Number of draws instead of the file's.

    Raises:
        ConfigError: It cannot be used; every problem is named.
    """
    return validate(path, campaign_tree(path, draws), Campaign)


def campaign_tree(
    path: Path | str, draws: int | None = None, programs: Mapping[str, str] = NO_PROGRAMS
) -> dict[Any, Any]:
    """Read a campaign file as plain data that is not checked yet.

    Args:
        path: The file.
        draws: Number of draws instead of the file's.
        programs: Files of foreign autopilots, by kind, for the variants that they fly.

    Raises:
        ConfigError: It cannot be read, is not a YAML mapping, or is a scenario, or no variant is
            flown by a program.
    """
    tree = read(path)
    if "scenario" not in tree and tree.keys() & {"aircraft", "extends"}:
        raise ConfigError(path, [Problem((), "a scenario, not a campaign; see gcs fly")])
    variants = tree.get("variants")
    for kind, program in programs.items():
        flown = [own for own in _autopilots(variants) if own.get("kind") == kind]
        for own in flown:
            own["binary"] = program
        if not flown:
            text = f"none has autopilot.kind: {kind}, for which --autopilot names a program"
            raise ConfigError(path, [Problem(("variants",), text)])
    return tree if draws is None else with_values(tree, {"draws": draws}, "--draws")


def _autopilots(variants: Any) -> Iterator[dict[Any, Any]]:
    """Yield the sections `autopilot` of variants, of which nothing is checked yet."""
    for changes in variants.values() if isinstance(variants, dict) else ():
        if isinstance(changes, dict) and isinstance(changes.get("autopilot"), dict):
            yield changes["autopilot"]
