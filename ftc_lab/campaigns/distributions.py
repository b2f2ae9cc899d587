"""Distributions of the factors of a campaign; each maps uniform numbers to values.

Every distribution is drawn by its inverse (`scipy.stats`, ``ppf``), so that a design of
experiments in the unit cube becomes one in the factors' values.
"""

from typing import Annotated, Any, Literal, TypeAlias

import numpy as np
from pydantic import Field, model_validator

from gcs.scenario.settings import cells
from mavlink_defs.config.models import AtMost, Model, Problems, repeated
from mavlink_defs.config.quantity import quantity

Value: TypeAlias = Any
"""A value of a key: plain data as YAML has it."""


def _ordered(low: float, high: float) -> None:
    if high <= low:
        raise Problems([(("high",), f"expected > low = {low!r}, got {high!r}")])


class Uniform(Model):
    """Every value between two ends is as likely.

    Attributes:
        kind: Every value between two ends is as likely.
        low: Lower end.
        high: Upper end.
    """

    kind: Literal["uniform"]
    low: float = quantity("")
    high: float = quantity("")

    @model_validator(mode="after")
    def _ends_in_order(self) -> "Uniform":
        _ordered(self.low, self.high)
        return self


class LogUniform(Model):
    """The logarithm is uniform: every order of magnitude is as likely.

    Attributes:
        kind: Every order of magnitude is as likely.
        low: Lower end.
        high: Upper end.
    """

    kind: Literal["log_uniform"]
    low: float = quantity("", gt=0.0)
    high: float = quantity("", gt=0.0)

    @model_validator(mode="after")
    def _ends_in_order(self) -> "LogUniform":
        _ordered(self.low, self.high)
        return self


class Normal(Model):
    """The normal distribution; it has no ends.

    Attributes:
        kind: Without ends.
        mean: Mean.
        deviation: Standard deviation.
    """

    kind: Literal["normal"]
    mean: float = quantity("")
    deviation: float = quantity("", gt=0.0)


class TruncatedNormal(Model):
    """The normal distribution given that the value lies between two ends.

    Attributes:
        kind: Normal, given that the value lies between two ends.
        mean: Mean before it is truncated.
        deviation: Standard deviation before it is truncated.
        low: Lower end.
        high: Upper end.
    """

    kind: Literal["truncated_normal"]
    mean: float = quantity("")
    deviation: float = quantity("", gt=0.0)
    low: float = quantity("")
    high: float = quantity("")

    @model_validator(mode="after")
    def _ends_in_order(self) -> "TruncatedNormal":
        _ordered(self.low, self.high)
        return self


class Choice(Model):
    """Every value of a list is as likely: numbers, texts, lists or mappings.

    Attributes:
        kind: Every value of a list is as likely.
        values: The values, anything that the key can have.
    """

    kind: Literal["choice"]
    values: Annotated[tuple[Value, ...], AtMost(10_000)] = Field(min_length=1)

    @model_validator(mode="after")
    def _each_once(self) -> "Choice":
        try:
            found = repeated(cells(self.values))
        except TypeError as problem:
            raise Problems([(("values",), f"expected values of a scenario: {problem}")]) from None
        Problems.check((("values", i), text) for i, text in found)
        return self


Distribution: TypeAlias = Annotated[
    Uniform | LogUniform | Normal | TruncatedNormal | Choice, Field(discriminator="kind")
]


def value_of(choice: Choice, cell: float | str) -> Value:
    """Return the value of a choice for which a table has a number or a text."""
    return choice.values[cells(choice.values).index(cell)]  # type: ignore[arg-type]  # of one kind


def quantiles(distribution: Distribution, uniform: np.ndarray) -> np.ndarray:
    """Return what a table has for uniform numbers in [0, 1), elementwise; see `cells`."""
    if isinstance(distribution, Choice):
        values = np.array(cells(distribution.values))
        index = np.minimum((uniform * len(values)).astype(int), len(values) - 1)
        return np.asarray(values[index])
    return np.asarray(_frozen(distribution).ppf(uniform))


def support(distribution: Distribution) -> tuple[Value, ...]:
    """Return the ends between which values are drawn, or the values of a choice."""
    if isinstance(distribution, Choice):
        return distribution.values
    low, high = _frozen(distribution).support()
    return float(low), float(high)


def _frozen(distribution: Distribution) -> Any:
    """Return the distribution of `scipy.stats`."""
    from scipy import stats

    match distribution:
        case Uniform(low=low, high=high):
            return stats.uniform(low, high - low)
        case LogUniform(low=low, high=high):
            return stats.loguniform(low, high)
        case Normal(mean=mean, deviation=deviation):
            return stats.norm(mean, deviation)
        case TruncatedNormal(mean=mean, deviation=deviation, low=low, high=high):
            ends = (low - mean) / deviation, (high - mean) / deviation
            return stats.truncnorm(*ends, loc=mean, scale=deviation)
        case _:
            raise TypeError(distribution)
