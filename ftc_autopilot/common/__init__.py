"""What control, guidance and services share: records, schedule, motion, geography."""
