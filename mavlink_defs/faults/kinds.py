"""What can fail, and how: the types of the tables of faults.

A `Target` is an actuator or a sensor, a `Kind` what happens to it. A `Family` has targets that fail
alike, are set by one command and share a key of scenarios. All else follows from these tables:
keys, options, forms, texts, checks and campaigns.
"""

import math
from dataclasses import dataclass

from mavlink_defs.constants import SURFACES

MAX_FREQUENCY_HZ = 500.0


@dataclass(frozen=True)
class FaultLimits:
    """Ranges of the actuators of an aircraft.

    Attributes:
        surfaces_deg: Least and largest angle of aileron, elevator and rudder [deg]; both are 0 for
            a surface that the aircraft has not.
        thrust_n: Largest thrust [N].
    """

    surfaces_deg: tuple[tuple[float, float], ...]
    thrust_n: float

    def has(self, actuator: str) -> bool:
        """Return whether the aircraft has an actuator; only surfaces may be missing."""
        return actuator not in SURFACES or any(self.surfaces_deg[SURFACES.index(actuator)])

    def bounds(self, actuator: str, *, partial: bool) -> tuple[float, float]:
        """Return the least and the largest value [deg or N], added to a command or in its place."""
        if actuator in SURFACES:
            return self.surfaces_deg[SURFACES.index(actuator)]
        return (-self.thrust_n if partial else 0.0), self.thrust_n


ANY_LIMITS = FaultLimits(((-math.inf, math.inf),) * len(SURFACES), math.inf)
"""Of an aircraft of which nothing is known."""


@dataclass(frozen=True)
class Target:
    """What can fail.

    Attributes:
        name: In keys, options and texts.
        failure_unit: FAILURE_UNIT.
        unit: Of its values, as people read them.
        per_unit: A unit of the value as the plant has it: in SI units, or in the units of a
            sensor's samples (see `sitl_plant.sensing.failures`).
        most: Largest value that can be set [unit]; infinite: the aircraft's `FaultLimits` say it.
        wrong: Kind and value of FAILURE_TYPE_WRONG without a value.
        axes: Whether it has three axes.
        has_imus: Whether each IMU has one.
        scales: Whether a scale of its samples means anything: neither a position nor the pressure
            of the air is 0 in flight.
    """

    name: str
    failure_unit: int
    unit: str
    per_unit: float = 1.0
    most: float = math.inf
    wrong: tuple[str, float] = ("", 0.0)
    axes: bool = False
    has_imus: bool = False
    scales: bool = True


@dataclass(frozen=True)
class Kind:
    """One kind of fault.

    Attributes:
        name: In keys, options and campaigns.
        code: Its number on the wire.
        template: The fault in a text, with the `value` or its `size` and `unit`, its sign as
            `sign` (+ or -) or `minus` (- or nothing), and `wave`, its oscillation.
        docs: What the value means: one sentence, or one for each of its keys; none: it has no
            value.
        unit: Of the value; ``{unit}`` is the target's.
        suffix: Of the key of a value without a unit.
        low: Least value.
        high: Largest value; infinite: the target's own, on either side.
        default: Value if none is given; NaN: one must be.
        partial: Whether a share of the command acts beside it, the effectiveness.
        wave: How a text has the frequency [Hz].
        switches: Whether it comes and goes with the frequency, which then is not 0.
        failure: The FAILURE_TYPE that it is an instance of.
        scales: Whether it multiplies samples.
        choice: The kind in a form; its name if empty.
        label: The value in a form; its name if empty.
    """

    name: str
    code: int
    template: str
    docs: tuple[str, ...] = ()
    unit: str = ""
    suffix: str = ""
    low: float = 0.0
    high: float = math.inf
    default: float = math.nan
    partial: bool = False
    wave: str = " · cos 2π {:g} Hz"
    switches: bool = False
    failure: str = ""
    scales: bool = False
    choice: str = ""
    label: str = ""

    @property
    def wrongs(self) -> bool:
        """Whether samples are wrong, which a single axis can be."""
        return self.failure == "wrong"

    @property
    def has_value(self) -> bool:
        """Whether the kind has a value."""
        return bool(self.docs)

    def fits(self, target: Target) -> bool:
        """Return whether a target can fail in this way."""
        return target.scales or not self.scales

    def unit_of(self, target: Target) -> str:
        """Return the unit of the value, such as "deg/s" or "Pa/s"."""
        unit = self.unit.format(unit=target.unit)
        return unit.replace("deg/s/s", "deg/s^2").replace("m/s^2/s", "m/s^3")

    def key(self, target: Target) -> str:
        """Return the key of the value in a scenario: ``bias_deg_s``, ``slow_factor``."""
        unit = self.unit_of(target).lower().replace("/", "_").replace("^", "") or self.suffix
        return f"{self.name}_{unit}" if unit else self.name

    def per_unit(self, target: Target) -> float:
        """Return a unit of the value as the plant has it, which is the target's if its unit is."""
        return target.per_unit if "{" in self.unit else 1.0

    def bounds(self, target: Target, limits: FaultLimits = ANY_LIMITS) -> tuple[float, float]:
        """Return the least and the largest value of a target of an aircraft, in its unit."""
        if math.isfinite(self.high):
            return self.low, self.high
        if math.isfinite(target.most):
            return -target.most, target.most
        return limits.bounds(target.name, partial=self.partial)

    def default_of(self, target: Target) -> float:
        """Return the value of a target if none is given; NaN: one must be."""
        if not self.has_value:
            return 0.0
        name, value = target.wrong
        return value if self.name == name else self.default

    def describe(self, value: float, unit: str, wave: str = "", minus: str = "-") -> str:
        """Return the value in a text: "+ 1 deg", "stuck at -3 deg".

        Args:
            value: The value.
            unit: Its unit as the text has it, with a space before it if there is to be one.
            wave: How it oscillates; empty if it does not.
            minus: The minus sign.
        """
        sign = minus if value < 0.0 else ""
        size = f"{abs(value):g}{unit}"
        signs = {"sign": sign or "+", "minus": sign}
        return self.template.format(**signs, value=value, unit=unit, size=size, wave=wave)


@dataclass(frozen=True)
class Family:
    """Targets that fail alike.

    Attributes:
        key: Of the target in a scenario's fault, and its field in FTC_FAULT.
        what: Each of them in a text, with its article.
        targets: The targets, in the order of their numbers on the wire.
        kinds: The kinds.
        command: MAV_CMD that sets a fault.
        params: What its seven parameters are: attributes of `mavlink_defs.faults.fault.Fault`,
            of which it has no others; "" for those that are empty.
        most: Faults of the family that one aircraft can hold at a time.
        first: Number of the first target; 0 elsewhere means that the fault is of another family.
        title: What a fault is called in an error.
        numbers: The numbers of the targets in an error.
        slots: What there are `most` of.
        value_label: The value in an error.
        default_code: Number of the kind that is meant where none is given; NaN: one must be.
    """

    key: str
    what: str
    targets: tuple[Target, ...]
    kinds: tuple[Kind, ...]
    command: int
    params: tuple[str, ...]
    most: int
    first: int
    title: str
    numbers: str
    slots: str
    value_label: str = "Value of {}"
    default_code: float = math.nan

    def number_of(self, target: Target) -> int:
        """Return the number of a target on the wire."""
        return self.first + self.targets.index(target)

    def target(self, number: float) -> Target | None:
        """Return the target that has a number on the wire; None if there is none."""
        known = range(self.first, self.first + len(self.targets))
        return self.targets[int(number) - self.first] if number in known else None

    def named(self, name: str) -> Target:
        """Return the target that has a name."""
        return next(target for target in self.targets if target.name == name)

    def kind(self, code: float, effectiveness: float = 0.0) -> Kind | None:
        """Return the kind of a fault on the wire; None if there is none.

        Args:
            code: Its number.
            effectiveness: Remaining effectiveness, which tells kinds of one number apart.
        """
        kinds = [kind for kind in self.kinds if kind.code == code]
        fitting = (kind for kind in kinds if kind.partial == (effectiveness != 0.0))
        return next(fitting, kinds[0] if kinds else None)

    def kinds_of(self, target: Target) -> dict[str, Kind]:
        """Return the kinds that fit a target, by name."""
        return {kind.name: kind for kind in self.kinds if kind.fits(target)}

    def default(self, failure: str, target: Target) -> tuple[Kind, float] | None:
        """Return what a FAILURE_TYPE does to a target if nobody says how much: kind and value."""
        kind = self.kinds_of(target).get(target.wrong[0] if failure == "wrong" else failure)
        return None if kind is None else (kind, kind.default_of(target))

    def keys_of(self, kind: Kind) -> dict[str, list[Target]]:
        """Return the keys of a kind's value, and the targets that each is of."""
        keys: dict[str, list[Target]] = {}
        for target in self.targets if kind.has_value else ():
            if kind.fits(target):
                keys.setdefault(kind.key(target), []).append(target)
        return keys

    def has(self, param: str) -> bool:
        """Return whether its faults have a parameter, such as an effectiveness."""
        return param in self.params
