"""The nRF24L01+ radio: registers, driver, antenna of the mesh, and an emulator of the chip.

[DS] in this package is the nRF24L01+ Product Specification 1.0 of Nordic Semiconductor, September
2008.
"""
