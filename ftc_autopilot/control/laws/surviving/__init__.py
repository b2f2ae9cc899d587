"""A law that flies on with one actuator lost in flight.

Healthy, it inverts the nominal model with moderate gains, corrected by the diagnosis of every
actuator. When one is lost, the others take over what must not be given up, roll and pitch; what
is given up is heading (without aileron or rudder) or airspeed (without the elevator).
"""

from ftc_autopilot.control.laws.surviving.law import surviving_law
from ftc_autopilot.control.laws.surviving.parameters import Surviving

__all__ = ["Surviving", "surviving_law"]
