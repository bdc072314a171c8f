"""Users' data: messages of up to 1,024 bytes over packets of 32 (docs/protocol.md, "Data")."""
