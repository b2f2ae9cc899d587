"""A flight that failed, flown again: by its recorded commands, and by other laws."""
