"""Memory of the diagnosis between two control steps."""

import numpy as np

from mavlink_defs.constants import N_CHANNELS

ACTUATOR = np.dtype(
    [
        # measurement
        ("position", "f8"),  # of the servo model
        ("commanded", "f8"),  # u: position through the measurement's filter
        ("measured", "f8"),  # y: what the actuator does, through the same filter
        ("centre", "f8"),  # slow mean of the residual r = y - u
        ("noise", "f8"),  # variance of r about its centre
        ("smooth", "f8"),  # r through another filter
        ("smooth_noise", "f8"),  # variance of that about the centre
        ("old_centre", "f8"),  # slower mean of r, of which r may creep away
        # regression y = ρ u + f over the window
        ("samples", "f8"),
        ("mean_u", "f8"),
        ("mean_y", "f8"),
        ("var_u", "f8"),
        ("cov", "f8"),
        ("var_y", "f8"),
        ("long_var_u", "f8"),  # their means over the longer memory
        ("long_cov", "f8"),
        ("long_var_y", "f8"),
        # timers [s]
        ("blank", "f8"),  # left until the window starts anew after a jump
        ("lock", "f8"),  # left until the next jump counts
        ("suspect", "f8"),  # left of a suspicion
        ("moving", "f8"),  # since a surface has been moved, if it is suspect
        ("way", "f8"),  # sign of the movements of a suspect surface
        ("rest", "f8"),  # left until r may be found to creep again
        ("agreed", "f8"),  # for which the condition of a decision has held
        ("followed", "f8"),  # for which a suspect actuator has been seen to follow
        ("since", "f8"),  # since the last decision
        ("quiet", "f8"),  # for which the residual has been small
        # results
        ("lost", "i8"),
        ("stuck", "f8"),  # mean of y while lost
        ("offset", "f8"),  # f, to be subtracted from a command
        ("effectiveness", "f8"),  # ρ in use
        ("confidence", "f8"),  # 1 - standard error of the window's ρ, not below 0
    ]
)
"""One actuator; amounts in rad, of the throttle in N."""

DIAGNOSIS = np.dtype(
    [
        ("age", "f8"),  # time since the law's first step [s]
        ("omega_filtered", "f8", (3,)),  # rad/s
        ("moment_filtered", "f8", (3,)),  # of ω × Jω - N0 [N m]
        ("actuators", ACTUATOR, (N_CHANNELS,)),  # in the order of FTC_ACTUATOR
    ]
)
