"""Motors: from rotor counts to cable displacement, the position loop, its limits, homing, and the bridge's states."""
