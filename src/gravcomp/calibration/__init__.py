"""Calibration of a robot's model to measured tips: modulus, damping, offsets and elasticity of the cables, with intervals."""
