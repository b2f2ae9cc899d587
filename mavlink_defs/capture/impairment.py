"""A bad link: loss, bursts, delay, jitter, reordering, duplication, bit errors, outages.

`Impairment` configures what a link does to datagrams, `mavlink_defs.capture.impairing` applies it.
"""

from typing import Annotated

from pydantic import model_validator

from mavlink_defs.config.models import AtMost, Model, Problems
from mavlink_defs.config.quantity import quantity, whole

Share = Annotated[float, quantity("", "Share of the datagrams.", ge=0.0, le=1.0)]


class Bursts(Model):
    """Gilbert-Elliott: the link changes between good and bad; `loss` of the link holds in good.

    Attributes:
        begin: Probability that a datagram finds a burst begun.
        end: Probability that it finds a burst ended.
        loss: Loss within a burst.
    """

    begin: Share
    end: float = quantity("", gt=0.0, le=1.0)
    loss: float = quantity("", default=1.0, ge=0.0, le=1.0)


class Outage(Model):
    """A time during which nothing passes.

    Attributes:
        from_s: Begin, inclusive.
        to_s: End, exclusive.
    """

    from_s: float = quantity("s", ge=0.0)
    to_s: float = quantity("s", gt=0.0)

    @model_validator(mode="after")
    def _in_order(self) -> "Outage":
        if self.to_s <= self.from_s:
            text = f"expected > from_s = {self.from_s!r} s, got {self.to_s!r}"
            raise Problems([(("to_s",), text)])
        return self


class Impairment(Model):
    """Impairments of each datagram on a link, in either direction; none by default.

    Attributes:
        seed: Seed of the random choices.
        loss: Share that is lost.
        bursts: Losses in bursts; none: no bursts.
        duplicate: Share that comes twice.
        delay_ms: Delay of every datagram.
        jitter_ms: Largest random addition to the delay; order is kept.
        reorder: Share that is overtaken.
        reorder_ms: Time by which overtaken datagrams are held back.
        bit_errors: Share of the bits that are inverted.
        outages: Times during which every datagram is lost [s].
    """

    seed: int = whole("", default=1, ge=0, le=2**63 - 1)
    loss: float = quantity("", default=0.0, ge=0.0, le=1.0)
    bursts: Bursts | None = None
    duplicate: float = quantity("", default=0.0, ge=0.0, le=1.0)
    delay_ms: float = quantity("ms", default=0.0, ge=0.0, le=60_000.0)
    jitter_ms: float = quantity("ms", default=0.0, ge=0.0, le=60_000.0)
    reorder: float = quantity("", default=0.0, ge=0.0, le=1.0)
    reorder_ms: float = quantity("ms", default=10.0, gt=0.0, le=60_000.0)
    bit_errors: float = quantity("", default=0.0, ge=0.0, le=0.5)
    outages: Annotated[tuple[Outage, ...], AtMost(1000)] = ()

    @property
    def is_identity(self) -> bool:
        """Whether every datagram arrives at once, as it is."""
        shares = (self.loss, self.duplicate, self.reorder, self.bit_errors)
        return not (any(shares) or self.delay_ms or self.jitter_ms or self.bursts or self.outages)
