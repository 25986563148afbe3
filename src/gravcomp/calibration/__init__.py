"""Calibration of a robot's model to measured tips: modulus, damping, the cables' offsets and elasticity, with how sure each of them is."""
