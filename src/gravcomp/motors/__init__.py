"""Motors: encoders, position loops, current limits, homing, the state machine of the bridge, and its guard process."""
