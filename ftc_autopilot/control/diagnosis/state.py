"""Memory of the diagnosis between two control steps."""

import numpy as np

from ftc_autopilot.control.diagnosis.instrument import PAST, TERMS
from mavlink_defs.constants import N_CHANNELS

HISTORY = 128
"""Control periods whose commands are remembered."""

ACTUATOR = np.dtype(
    [
        # measurement
        ("position", "f8"),  # of the servo model
        ("commanded", "f8"),  # u: position through the measurement's filter
        ("measured", "f8"),  # y: what the actuator does, through the same filter
        ("mean", "f8"),  # slow mean of the residual r = y - u
        ("variance", "f8"),  # of r about that mean
        ("smooth", "f8"),  # r through another filter
        ("smooth_variance", "f8"),  # of the smoothed r about the mean
        ("smooth_u", "f8"),  # u through that filter
        ("command_mean", "f8"),  # slow mean of u
        ("moved_var_u", "f8"),  # of the smoothed u about it
        ("moved_cov", "f8"),  # of it and the smoothed r: what of r the command explains
        ("side", "f8"),  # on which that was last far
        ("swings", "f8"),  # how often it changed, with forgetting
        ("followed", "f8"),  # r when it was last seen to follow; 0 once r is another
        ("drift_mean", "f8"),  # slower mean of r, from which r may drift
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
        ("dead_steps", "i8"),  # dead time that the control check has found [control periods]
        # by the dither alone
        ("dither", "f8"),  # what the present command has of it
        ("z_position", "f8"),  # it, when it acts, through the model of the servo
        ("z", "f8"),  # and through the filter of the measurement
        ("z_s", "f8"),  # time since the suspicion
        ("z_samples", "f8"),
        ("z_y", "f8"),  # y and u when it was raised
        ("z_u", "f8"),
        ("z_tail", "f8"),  # what is left of a unit jump that raised it, in y
        ("z_past", "f8", (PAST,)),  # z and u of the last steps
        ("u_past", "f8", (PAST,)),
        ("moments", "f8", (TERMS, TERMS)),  # lower half
        # timers [s]
        ("blanking_s", "f8"),  # left until the window restarts after a jump
        ("holdoff_s", "f8"),  # left until the next jump counts
        ("suspect_s", "f8"),  # left of a suspicion
        ("cooldown_s", "f8"),  # left until a suspicion may be raised again
        ("dither_s", "f8"),  # for which a surface has been dithered, if it is suspect
        ("dither_sign", "f8"),  # to which side
        ("confirmed_s", "f8"),  # for which the condition of a decision has held
        ("followed_s", "f8"),  # for which a suspect actuator has been seen to follow
        ("decided_s", "f8"),  # since the last decision
        ("stop_s", "f8"),  # for which the command has been at the stop, the residual large
        ("unsure", "f8"),  # by how much `commanded` may be wrong, as nobody knows since when
        ("quiet_s", "f8"),  # for which the residual has been small
        ("lately_s", "f8"),  # left, in service, in which no cooldown holds after a loss
        ("care_s", "f8"),  # left until one with a relapse may return
        ("owed_s", "f8"),  # time lost less time in service since, for which it is not trusted
        ("patience_s", "f8"),  # for which it must be well, doubled by each relapse
        # results
        ("lost", "i8"),
        ("stuck", "f8"),  # mean of y while lost
        ("sticks", "f8"),  # y when it was lost
        ("offset", "f8"),  # f, to be subtracted from a command
        ("effectiveness", "f8"),  # ρ in use
        ("confidence", "f8"),  # 1 - standard error of the window's ρ, not below 0
    ]
)
"""One actuator; amounts in rad, of the throttle in N."""

DIAGNOSIS = np.dtype(
    [
        ("age", "f8"),  # time since the law's first step [s]; it stands still after a gap
        ("step", "i8"),  # steps made
        ("ahead", "i8"),  # delay of the last step [control periods]
        ("settling_s", "f8"),  # left after a gap until anything is learnt again [s]
        ("held", "f8", (HISTORY, N_CHANNELS)),  # commands in force over the last steps
        ("dithers", "f8", (HISTORY, N_CHANNELS)),  # their dithers
        ("omega_filtered", "f8", (3,)),  # rad/s
        ("moment_filtered", "f8", (3,)),  # of ω × Jω - N0 [N m]
        ("actuators", ACTUATOR, (N_CHANNELS,)),  # in the order of FTC_ACTUATOR
    ]
)
