"""A law that sends a command only when not sending it would take the aircraft out of a tube.

A disturbance observer (`observer`) and the nominal aircraft predict the errors under the commands
in force (`prediction`). Around the reference lies a tube (`tube`); a channel is sent when its
error is about to leave it, and then the command that keeps it inside for longest (`plan`). The
surviving law watches, and takes over when an actuator is lost (`fallback`).
"""

from ftc_autopilot.control.laws.tube.law import tube_law
from ftc_autopilot.control.laws.tube.parameters import Tube

__all__ = ["Tube", "tube_law"]
