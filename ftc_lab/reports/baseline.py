"""The baselines of a flight in a table and in sentences."""

from collections.abc import Iterator, Sequence

from ftc_lab.baselines.baseline import Baseline, saved
from ftc_lab.baselines.senders import COARSE, FINE, YARDSTICKS, Sender, SenderVerdict
from ftc_lab.campaigns.statistics import proportion
from ftc_lab.reports.markdown import bullets, table
from gcs.results.quantities import milliseconds, percent
from mavlink_defs.constants import ACTUATORS

COLUMNS = (
    "sender",
    "transmissions",
    "saved by the trigger",
    "largest IAE ratio to triggered, against the reference",
    "against the commands",
)


def baseline_report(baseline: Baseline) -> str:
    """Return the whole report as Markdown."""
    return (
        f"# Baselines of {baseline.scenario}\n\n"
        f"Law `{baseline.law}` with trigger `{baseline.trigger}`; periodic senders fly the law "
        f"`{baseline.periodic_law}`. Transmissions of single channels, all UAVs.\n\n"
        f"{table(COLUMNS, baseline_rows(baseline))}\n{bullets(baseline_sentences(baseline))}"
    )


def baseline_rows(baseline: Baseline) -> Iterator[tuple[str, ...]]:
    """Yield a line for the triggered flight and for each baseline, texts by `COLUMNS`."""
    sent, uniform = baseline.transmissions, baseline.slowest_uniform
    yield f"triggered ({baseline.trigger})", str(sent), "", "1.000", "1.000"
    every = baseline.every_period
    first = baseline.uniform[0]
    ratios = _ratios(first) if set(first.sender.periods) == {1} else ("-", "-")
    period = milliseconds(baseline.step_us / 1e6)
    yield f"every {period}", str(every), percent(saved(sent, every)), *ratios
    if uniform is not None:
        yield _line(f"slowest equal: every {_sender(baseline, uniform.sender)}", baseline, uniform)
    if (own := baseline.per_channel) is not None:
        yield _line(f"the same by channel: {_sender(baseline, own.sender)}", baseline, own)
    if (lax := baseline.slowest_by_commands) is not None:
        name = f"slowest equal against the commands: every {_sender(baseline, lax.sender)}"
        yield _line(name, baseline, lax)
    if baseline.robustness is not None and (robust := baseline.robustness.slowest) is not None:
        yield (
            f"equally robust: every {_sender(baseline, robust.sender)}",
            str(robust.transmissions),
            percent(saved(sent, robust.transmissions)),
            "-",
            "-",
        )


def baseline_sentences(baseline: Baseline) -> Iterator[str]:
    """Yield what was searched, and what the table does not say."""
    longest = _ms(baseline, baseline.uniform[-1].sender.periods)
    limit = f"{100.0 * (baseline.largest_ratio - 1.0):g} %"
    yield (
        "Equal: the flight is completed, and no IAE of any UAV against the filtered reference is "
        f"more than {limit} above the triggered flight's. Most of an IAE against the "
        "commands is the lag of the reference filter, the same for every sender: equal by that "
        "says less."
    )
    uniform = baseline.slowest_uniform
    listed = (
        f"{len(baseline.uniform)} periods up to {longest}, neighbours at "
        f"most {100.0 * (FINE - 1.0):.0f} % or one control period apart"
    )
    if uniform is None:
        yield f"One period for all channels: none of {listed}, is equal."
    else:
        faster = [one for one in baseline.uniform if one.sender.periods < uniform.sender.periods]
        worse = sum(not one.good for one in faster)
        yield (
            f"One period for all channels: {listed}, were all flown. Of the {len(faster)} faster "
            f"than the one in the table {worse} are not equal; nothing is known of periods "
            "that are not on the list."
        )
    if baseline.per_channel is not None:
        yield (
            "A period for each channel: a local optimum. From the uniform one on, the longer "
            "period that saves most was taken, as long as there was an equal one among periods "
            f"{100.0 * (COARSE - 1.0):.0f} % apart; changing two channels at once may save more."
        )
    if (robust := baseline.robustness) is not None:
        kept, _ = robust.triggered
        low = proportion(kept, robust.drawn).low
        yield (
            "Kept: completed, no IAE against the filtered reference above "
            f"{robust.largest_ratio:g} times the IAE of the triggered flight of the nominal "
            f"aircraft. The triggered sender keeps {kept} "
            f"of {robust.drawn} uncertain aircraft (at 95 %: at least {percent(low)} of all)."
        )
        if (slowest := robust.slowest) is None:
            yield f"No periodic sender on the list keeps {100.0 * robust.share:g} % of them."
        else:
            yield (
                f"Equally robust: the slowest of periods {100.0 * (COARSE - 1.0):.0f} % apart that "
                f"keeps {100.0 * robust.share:g} %; it keeps {slowest.kept} of {slowest.flown}. "
                f"{len(robust.checked) - 1} slower ones do not."
            )


def _line(name: str, baseline: Baseline, one: SenderVerdict) -> tuple[str, ...]:
    return (
        name,
        str(one.transmissions),
        percent(saved(baseline.transmissions, one.transmissions)),
        *_ratios(one),
    )


def _ratios(one: SenderVerdict) -> tuple[str, str]:
    """Return the largest IAEs, relative to the triggered flight's, by yardstick."""
    known = (one.ratios.get(yardstick) for yardstick in YARDSTICKS)
    reference, commands = ("not completed" if x is None else f"{x:.3f}" for x in known)
    return reference, commands


def _sender(baseline: Baseline, one: Sender) -> str:
    """Format periods, and the parameters of a law that has others by the clock."""
    own = "".join(f", {name} {value:g}" for name, value in one.parameters.items())
    return _ms(baseline, one.periods) + own


def _ms(baseline: Baseline, periods: Sequence[int]) -> str:
    """Format periods: one for all channels, or by channel."""
    times = [milliseconds(n * baseline.step_us / 1e6) for n in periods]
    if len(set(times)) == 1:
        return times[0]
    return ", ".join(f"{name} {time}" for name, time in zip(ACTUATORS, times, strict=True))
