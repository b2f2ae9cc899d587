"""What a flight leaves: recordings, summaries, exports, run folders."""
