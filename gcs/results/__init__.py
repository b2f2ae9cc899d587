"""Results of flights: recordings, summaries, exports, run folders."""
