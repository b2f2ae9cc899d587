"""From pulses of ArduPilot to commands of the plant."""

import numpy as np

from mavlink_defs.constants import AILERON, ELEVATOR, N_CHANNELS, RUDDER, THROTTLE
from mavlink_defs.runtime.jit import in_python
from sitl_plant.airframe import aerodynamics
from sitl_plant.airframe.aircraft import AircraftRecord
from sitl_plant.foreign.ardupilot.config import ArduPilot, SurfaceOutput, ThrottleOutput

_SURFACES = (AILERON, ELEVATOR, RUDDER)
_aerodynamics = in_python(aerodynamics.aerodynamics)


class Outputs:
    """The outputs of one ArduPilot, as an aircraft's actuators take them.

    Attributes:
        shares: What was commanded last, shape (4,), float32 as on our wire: aileron, elevator,
            rudder from -1 to 1 in the plant's signs, throttle from 0 to 1. A surface whose output
            is off (0 µs) stays where it is, and an engine stops.
    """

    def __init__(self, config: ArduPilot, aircraft: AircraftRecord) -> None:
        """Begin in the middle, without thrust.

        Args:
            config: Which output moves which actuator.
            aircraft: The aircraft, whose signs it needs: a longer pulse is to turn it right, or
                its nose up, by whatever deflection does that.
        """
        self._config = config
        C = _aerodynamics((1.0, 0.0, 0.0), (0.0, 0.0, 0.0), aircraft).C
        self._signs = [-1.0 if C[c][c] < 0.0 else 1.0 for c in _SURFACES]
        self.shares = np.zeros(N_CHANNELS, np.float32)

    def receive(self, pulses_us: tuple[int, ...]) -> None:
        """Take the pulses of a frame, of 16 or 32 outputs [µs]."""
        for c, surface in zip(_SURFACES, self._config.surfaces, strict=True):
            pulse = _pulse(pulses_us, surface)
            if pulse > 0:
                self.shares[c] = self._signs[c] * surface_share(pulse, surface)
        throttle = self._config.throttle
        self.shares[THROTTLE] = throttle_share(_pulse(pulses_us, throttle), throttle)


def surface_share(pulse_us: float, surface: SurfaceOutput) -> float:
    """Return which share of a surface's full moment a pulse commands, from -1 to 1.

    Positive is to the right, or nose up. On each side of the trim the pulse counts by that side.
    """
    off = pulse_us - surface.trim_us
    side = surface.max_us - surface.trim_us if off > 0.0 else surface.trim_us - surface.min_us
    share = min(max(off / side, -1.0), 1.0)
    return -share if surface.reversed else share


def throttle_share(pulse_us: float, throttle: ThrottleOutput) -> float:
    """Return which share of the full thrust a pulse commands, from 0 to 1."""
    share = (pulse_us - throttle.min_us) / (throttle.max_us - throttle.min_us)
    return min(max(share, 0.0), 1.0)


def _pulse(pulses_us: tuple[int, ...], output: SurfaceOutput | ThrottleOutput) -> int:
    """Return an output's pulse [µs]; 0 of one that a packet of 16 channels does not have."""
    return pulses_us[output.channel - 1] if output.channel <= len(pulses_us) else 0
