"""An estimate of an aircraft's motion from what its sensors report, for the laws to fly by."""
