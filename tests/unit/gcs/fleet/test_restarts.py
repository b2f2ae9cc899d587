"""When processes that died are started again."""

from gcs.fleet.restarts import MAX_IN_A_ROW, Restarts


def pause_s(restarts: Restarts, died_at: float) -> float | None:
    """Time from a death to the restart; None if the process is given up."""
    now = died_at
    while not (due := restarts.is_due("uav1", now)):
        if due is None:
            return None
        now += 0.125
    restarts.started("uav1", now)
    return now - died_at


def test_at_once_then_with_growing_pauses_and_not_for_ever() -> None:
    restarts = Restarts()
    restarts.started("uav1", 0.0)
    assert restarts.counts["uav1"] == 0
    now, pauses = 1.0, []
    while (pause := pause_s(restarts, now)) is not None:
        pauses.append(pause)
        now += pause + 1.0
    assert pauses == [0.0, 0.5, 1.0, 2.0, 4.0]
    assert len(pauses) == MAX_IN_A_ROW == restarts.counts["uav1"]


def test_after_a_long_run_there_is_no_pause() -> None:
    restarts = Restarts()
    restarts.started("uav1", 0.0)
    for k in range(20):
        assert pause_s(restarts, 3600.0 * (k + 1)) == 0.0
    assert restarts.counts["uav1"] == 20


def test_each_process_has_pauses_of_its_own() -> None:
    restarts = Restarts()
    for name in ("uav1", "uav2"):
        restarts.started(name, 0.0)
    pause_s(restarts, 1.0)
    assert restarts.is_due("uav2", 1.0)
    assert restarts.counts["uav2"] == 0  # until it is started
