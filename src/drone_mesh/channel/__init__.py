"""One channel shared by half-duplex packet radios: when a node may send, and how often it tries.

Decides who sends when, what waits in which order and when a packet is given up. Knows no chip: a
radio stands below it behind `radio.PacketRadio`. May call `communication`, whose packets it sorts.
"""
