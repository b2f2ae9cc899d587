"""The simulator's side of the interfaces by which autopilots of other projects fly a plant."""
