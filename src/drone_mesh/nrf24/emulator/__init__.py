"""An nRF24L01+ and the air between several of them, in software.

An emulated chip has the interface of a real one: an SPI device with `xfer2`, a CE pin and an IRQ
pin. Any driver that accepts these runs on it.
"""
