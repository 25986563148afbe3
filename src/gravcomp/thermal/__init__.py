"""Temperature of the IMU: the control of its heater, and the thermal plant that the virtual robot uses."""

from gravcomp.thermal.heater import HeaterControl, HeaterFault, HeaterOptions, HeaterState
from gravcomp.thermal.plant import ThermalPlant, ThermalPlantOptions

__all__ = ["HeaterControl", "HeaterFault", "HeaterOptions", "HeaterState", "ThermalPlant", "ThermalPlantOptions"]
