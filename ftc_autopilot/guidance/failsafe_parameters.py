"""Parameters of what a vehicle does by itself, with the name and the numbers that PX4 has.

https://docs.px4.io/main/en/advanced_config/parameter_reference.html#COM_ACT_FAIL_ACT.
"""

from typing import Literal

from mavlink_defs.config.models import Model

REPORT, TO_LOITER, TO_LAND, TO_RTL = range(4)
"""COM_ACT_FAIL_ACT, in the order of `FailsafeParameters.act_fail_act`."""


class FailsafeParameters(Model):
    """What a vehicle does by itself when something of it fails.

    Attributes:
        act_fail_act: What an actuator that the diagnosis declares lost does: it is reported, and
            LOITER, a landing or RTL is flown. Without thrust the latter two are a glide to the
            runway.
    """

    act_fail_act: Literal["report", "loiter", "land", "rtl"] = "report"
