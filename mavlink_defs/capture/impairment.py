"""A bad link: loss, bursts, delay, jitter, reordering, duplication, bit errors, outages.

`Impairment` configures what a link does to datagrams, `mavlink_defs.capture.impairing` applies it.
"""

from typing import Annotated

from pydantic import Field, model_validator

from mavlink_defs.config.models import AtMost, Model, Problems
from mavlink_defs.config.quantity import quantity, whole

Share = Annotated[float, quantity("", ge=0.0, le=1.0, doc="Share of the datagrams.")]


class Bursts(Model):
    """Gilbert-Elliott: the link changes between good and bad; `loss` of the link holds in good."""

    begin: Share = Field(description="Probability that a datagram finds a burst begun.")
    end: float = quantity("", gt=0.0, le=1.0, doc="Probability that it finds a burst ended.")
    loss: float = quantity("", ge=0.0, le=1.0, default=1.0, doc="Loss within a burst.")


class Outage(Model):
    """A time during which nothing passes."""

    from_s: float = quantity("s", ge=0.0, doc="Begin, inclusive.")
    to_s: float = quantity("s", gt=0.0, doc="End, exclusive.")

    @model_validator(mode="after")
    def _in_order(self) -> "Outage":
        if self.to_s <= self.from_s:
            text = f"expected > from_s = {self.from_s!r} s, got {self.to_s!r}"
            raise Problems([(("to_s",), text)])
        return self


class Impairment(Model):
    """Impairments of each datagram on a link, in either direction; none by default."""

    seed: int = whole("", ge=0, le=2**63 - 1, default=1, doc="Seed of the random choices.")
    loss: float = quantity("", ge=0.0, le=1.0, default=0.0, doc="Share that is lost.")
    bursts: Bursts | None = Field(default=None, description="Losses in bursts; none: no bursts.")
    duplicate: float = quantity("", ge=0.0, le=1.0, default=0.0, doc="Share that comes twice.")
    delay_ms: float = quantity(
        "ms", ge=0.0, le=60_000.0, default=0.0, doc="Delay of every datagram."
    )
    jitter_ms: float = quantity(
        "ms",
        ge=0.0,
        le=60_000.0,
        default=0.0,
        doc="Largest random addition to the delay; order is kept.",
    )
    reorder: float = quantity("", ge=0.0, le=1.0, default=0.0, doc="Share that is overtaken.")
    reorder_ms: float = quantity(
        "ms",
        gt=0.0,
        le=60_000.0,
        default=10.0,
        doc="Time by which overtaken datagrams are held back.",
    )
    bit_errors: float = quantity(
        "", ge=0.0, le=0.5, default=0.0, doc="Share of the bits that are inverted."
    )
    outages: Annotated[tuple[Outage, ...], AtMost(1000)] = Field(
        default=(), description="Times during which every datagram is lost [s]."
    )

    @property
    def is_identity(self) -> bool:
        """Whether every datagram arrives at once, as it is."""
        shares = (self.loss, self.duplicate, self.reorder, self.bit_errors)
        return not (any(shares) or self.delay_ms or self.jitter_ms or self.bursts or self.outages)
