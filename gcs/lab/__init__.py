"""What serves research: campaigns, sweeps, baselines, theory; needs `ftc-sitl[lab]`."""
