"""A control law for ftc-sitl, with its scenarios."""
