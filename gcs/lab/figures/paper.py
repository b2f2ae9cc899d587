"""The paper's figures of its scenarios, 5 to 11."""

from gcs.figures.tracking import fig6, fig10, fig11
from gcs.lab.figures.events import fig7, fig8, fig9
from gcs.lab.figures.trajectories import fig5

__all__ = ["fig5", "fig6", "fig7", "fig8", "fig9", "fig10", "fig11"]
