"""An nRF24L01+ and the air between several of them, in software.

The chips stand behind the same two things that a real one stands behind: an SPI device with
`xfer2` and a CE pin (and an IRQ pin). So any driver that can be given those can be tried here,
ours and others.
"""
