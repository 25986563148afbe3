"""The image for the STM32F407 in an emulator of its processor, with the peripherals that it uses as models."""
