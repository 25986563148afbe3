"""Errors of IMUs by grade, from data sheets: what the virtual board assumes where its parameters do not say otherwise. SI.

bmi088 is the board's own chip (Bosch BMI088 data sheet, biases after soldering and a calibration of the offsets). consumer stands
for six-axis chips of telephones (TDK ICM-20948, Bosch BMI160), industrial for calibrated modules (Analog Devices ADIS16470).
"""

import math

_DEG = math.pi / 180.0

IMU_GRADES: dict[str, dict[str, float]] = {
    "bmi088": {
        "accelerometer_noise": 175e-6, "gyroscope_noise": 0.014 * _DEG, "accelerometer_bias": 0.003, "accelerometer_scale": 0.001,
        "accelerometer_drift": 0.0002, "gyroscope_bias": 0.4 * _DEG, "gyroscope_drift": 0.015 * _DEG,
        "gyroscope_walk": 0.0005 * _DEG,
    },
    "consumer": {
        "accelerometer_noise": 230e-6, "gyroscope_noise": 0.015 * _DEG, "accelerometer_bias": 0.015, "accelerometer_scale": 0.005,
        "accelerometer_drift": 0.0008, "gyroscope_bias": 2.0 * _DEG, "gyroscope_drift": 0.05 * _DEG,
        "gyroscope_walk": 0.002 * _DEG,
    },
    "industrial": {
        "accelerometer_noise": 60e-6, "gyroscope_noise": 0.005 * _DEG, "accelerometer_bias": 0.001, "accelerometer_scale": 0.0003,
        "accelerometer_drift": 0.00005, "gyroscope_bias": 0.1 * _DEG, "gyroscope_drift": 0.003 * _DEG,
        "gyroscope_walk": 0.0001 * _DEG,
    },
}  # fmt: skip
"""Noise densities in g/sqrt(Hz) and (rad/s)/sqrt(Hz), biases in g and rad/s, drifts per K, walk in (rad/s)/sqrt(s)."""
