"""The plant's side of ArduPilot's JSON interface: ArduPilot SITLs fly the plant's aircraft."""
