"""What was flown: a list of all folders of results below a folder."""
