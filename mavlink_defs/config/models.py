"""Building blocks of configuration models.

Models are frozen and have fixed keys; fields with units are declared by
`mavlink_defs.config.quantity`, and files are read by `mavlink_defs.config.files`. Checks across
keys are in the models: their validators raise `Problems`, which has its own module,
`mavlink_defs.config.problems`, for programs that check no model.
"""

import operator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from pydantic import AfterValidator, BaseModel, ConfigDict, GetCoreSchemaHandler, model_validator
from pydantic_core import core_schema

from mavlink_defs.config import renamed
from mavlink_defs.config.problems import (
    ConfigError,
    Loc,
    Problem,
    ProblemKind,
    Problems,
    counted,
    repeated,
    shown,
    unknown_key,
)
from mavlink_defs.config.quantity import whole
from mavlink_defs.constants import LAST_SYSTEM
from mavlink_defs.docstrings import texts_of
from mavlink_defs.endpoint import EndpointError, parse_address
from mavlink_defs.visible import visible, visible_lines

__all__ = [
    "AtMost",
    "ConfigError",
    "HostPort",
    "Loc",
    "Model",
    "Port",
    "Problem",
    "ProblemKind",
    "Problems",
    "Renaming",
    "SystemId",
    "counted",
    "repeated",
    "shown",
    "unknown_key",
]


class Model(BaseModel):
    """A mapping with fixed keys; frozen, and unknown keys are refused.

    A key's description is what "Attributes" of the docstring says of it, else its field's own.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    @classmethod
    def __pydantic_init_subclass__(cls, **options: Any) -> None:
        super().__pydantic_init_subclass__(**options)
        for name, text in texts_of(cls.__doc__, "Attributes").items():
            if name in cls.model_fields:
                cls.model_fields[name].description = text


class Renaming(Model):
    """A model with keys that have other names than in the version before.

    It reads both, and warns of old ones, as of attributes that Python programs read. Of two
    names of one key the later one counts: what is merged into a mapping comes last.

    Attributes:
        SECTION: Its section in the table of renamed keys, `mavlink_defs.config.renamed`.
    """

    SECTION: ClassVar[str]

    def __init_subclass__(cls, **options: Any) -> None:
        for before, now in renamed.names_of(cls.SECTION).items():
            if before in cls.__dict__:  # what it declares would have no effect
                raise TypeError(renamed.text_of(before, now))
        super().__init_subclass__(**options)

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            names = renamed.names_of(self.SECTION)
            if name not in names:
                return super().__getattr__(name)
            renamed.warn(name, names[name])
            return operator.attrgetter(names[name])(self)

    @model_validator(mode="before")
    @classmethod
    def _by_present_names(cls, data: Any) -> Any:
        if not isinstance(data, dict):
            return data
        names = renamed.names_of(cls.SECTION)
        found: dict[Any, Any] = {}
        for key, value in data.items():
            now, laid = key, value
            if key in names:
                renamed.warn(key, names[key])
                now, _, inner = names[key].partition(".")
                laid = {inner: value} if inner else value
            earlier = found.get(now)
            if isinstance(laid, dict) and isinstance(earlier, dict):
                laid = {**earlier, **laid}
            found[now] = laid
        return found


@dataclass(frozen=True)
class AtMost:
    """Of a list or mapping: the most entries that it may have, counted before any is checked."""

    most: int
    noun: str = "entry"

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> core_schema.CoreSchema:
        return core_schema.no_info_before_validator_function(self._counted, handler(source))

    def _counted(self, value: Any) -> Any:
        if isinstance(value, list | tuple | dict) and len(value) > self.most:
            raise ValueError(f"expected at most {counted(self.most, self.noun)}, got {len(value)}")
        return value


def _normal_address(text: str) -> str:
    try:
        return str(parse_address(text))
    except EndpointError as exc:
        raise ValueError(str(exc)) from exc


Title = Annotated[str, AfterValidator(visible)]
"""A name or a line for people: control characters become escapes where it enters."""

Prose = Annotated[str, AfterValidator(visible_lines)]
"""Text for people, of several lines perhaps."""

HostPort = Annotated[str, AfterValidator(_normal_address)]
"""A UDP address, "host:port"."""

Port = Annotated[int, whole("", "UDP port.", ge=1, le=65535)]

SystemId = Annotated[int, whole("", "UAV number, its MAVLink system id.", ge=1, le=LAST_SYSTEM)]
