"""The share of transmissions that event-triggered control saves."""

from mavlink_defs.constants import ACTUATORS


def saving(events: int, periods: int | None, channels: int = len(ACTUATORS)) -> float | None:
    """Return the share of a periodic sender's transmissions that were not sent.

    Args:
        events: Transmissions.
        periods: Control periods in which each channel would have been sent; None if unknown.
        channels: Actuator channels that `events` counts.

    Returns:
        The share; None if there was no period, or none is known.
    """
    return 1.0 - events / (periods * channels) if periods else None
