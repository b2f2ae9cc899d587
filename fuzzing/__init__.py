"""Fuzzing of everything that takes datagrams: ``make fuzz``, and what its tests share."""
