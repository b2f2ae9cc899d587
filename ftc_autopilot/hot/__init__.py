"""The hot loop: links to plant and neighbours, control steps, checkpoint."""
