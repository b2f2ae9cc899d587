"""The clock of a vehicle: time since boot, and the date.

A ground station sees a vehicle that is alive from its start. So the clock runs by the wall clock
while simulated time is paused, and by simulated time while that runs: intervals in a log are
the flight's, however fast it is flown.
"""


class VehicleClock:
    """Time since boot and Unix time; neither ever goes back.

    The date is read once, at boot: what happens to the machine's date later changes nothing.

    Attributes:
        boot_us: Time since boot [µs].
    """

    def __init__(self, unix_us: int) -> None:
        """Start at boot.

        Args:
            unix_us: Unix time [µs].
        """
        self.boot_us = 0
        self._unix_at_boot_us = unix_us
        self._read_us: int | None = None  # on the clock that `advance` followed last
        self._simulated = False

    @property
    def unix_us(self) -> int:
        """Unix time [µs]."""
        return self._unix_at_boot_us + self.boot_us

    @property
    def boot_ms(self) -> int:
        """Time since boot as most messages have it [ms]; wraps after 49 days."""
        return self.boot_us // 1000 % 2**32

    def advance(self, now_us: int, simulated_us: int, running: bool) -> None:
        """Follow simulated time if it runs, else the wall clock.

        Args:
            now_us: Wall-clock time, from any origin [µs].
            simulated_us: Simulated time [µs].
            running: Whether simulated time runs.
        """
        read_us = simulated_us if running else now_us
        if self._read_us is not None and running == self._simulated:
            self.boot_us += max(read_us - self._read_us, 0)
        self._read_us, self._simulated = read_us, running
