"""Temperature of the IMU: the control that keeps it still, and the plant it is tested against."""

from gravcomp.thermal.heater import HeaterControl, HeaterFault, HeaterOptions, HeaterState
from gravcomp.thermal.plant import ThermalPlant, ThermalPlantOptions

__all__ = ["HeaterControl", "HeaterFault", "HeaterOptions", "HeaterState", "ThermalPlant", "ThermalPlantOptions"]
