"""What serves research: campaigns, sweeps, baselines, theory. Campaigns need the extra `lab`."""
