"""The sensors that an autopilot navigates by, as HIL_SENSOR and HIL_GPS report them."""
