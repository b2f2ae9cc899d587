"""Every parameter of a flight derived from the aircraft: laws, trigger, diagnosis, guidance.

The defaults were found on the paper's aircraft at 45 m/s. By similarity they mean the same to
another aircraft when each is multiplied as its unit says; what similarity cannot know, servos,
noise, stops and the thrust to spare, has rules of its own.
"""
