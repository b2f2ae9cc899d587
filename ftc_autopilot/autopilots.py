"""The autopilots of one process: the compiled loop, and each one's services when it asks."""

from collections.abc import Sequence

from ftc_autopilot.autopilot import Autopilot
from ftc_autopilot.hot.loop import new_loops, run
from mavlink_defs.framing.hot_link import Outcome


class Autopilots:
    """One autopilot, or in lockstep several."""

    def __init__(self, autopilots: Sequence[Autopilot]) -> None:
        """Take autopilots that have booted; at least one."""
        self._autopilots = autopilots
        self.stopping = False

    def fly(self) -> None:
        """Serve all links until the simulation is over, or `stopping` is set."""
        flying = list(self._autopilots)
        while flying and not self.stopping:
            self._fly_until_one_ends(flying)
            flying = [autopilot for autopilot in flying if not autopilot.is_over]
        for autopilot in flying:
            autopilot.stop()

    def _fly_until_one_ends(self, flying: Sequence[Autopilot]) -> None:
        loops = new_loops([one.loop for one in flying], [one.sockets for one in flying])
        until_s, until_step = loops.state["until_s"], loops.state["until_step"]
        asking = list(enumerate(flying))
        while not self.stopping:
            for i, autopilot in asking:
                until_s[i], until_step[i] = autopilot.until_s(), autopilot.until_step()
            run(loops)
            outcomes = loops.state["outcome"].tolist()
            asking = [(i, flying[i]) for i, outcome in enumerate(outcomes) if outcome]
            for i, autopilot in asking:
                autopilot.serve(Outcome(outcomes[i]))
            if any(autopilot.is_over for _, autopilot in asking):
                return
