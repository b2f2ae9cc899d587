"""Configuration of the air: disturbances, steady wind, shear, one gust, and turbulence."""

from typing import Annotated, Literal

from pydantic import Discriminator, Field, Tag

from mavlink_defs.config.models import Model
from mavlink_defs.config.quantity import quantity


class Sinusoid(Model):
    """sin * sin(rate t) + cos * cos(rate t), in the unit of the disturbance it belongs to."""

    sin: float = quantity("", default=0.0, doc="Amplitude of the sine.")
    cos: float = quantity("", default=0.0, doc="Amplitude of the cosine.")
    rate_rad_s: float = quantity("rad/s", ge=0.0, doc="Angular frequency; 0: constant.")


_NONE = Sinusoid(rate_rad_s=0.0)


class Axes(Model):
    """One sinusoid for each body axis."""

    x: Sinusoid = Field(default=_NONE, description="Along x, forward.")
    y: Sinusoid = Field(default=_NONE, description="Along y, to the right.")
    z: Sinusoid = Field(default=_NONE, description="Along z, down.")


class Disturbance(Model):
    """Disturbances d_v and d_omega of eqs. (2) and (4), functions of simulation time."""

    acceleration_m_s2: Axes = Field(default=Axes(), description="d_v of (2) [m/s^2].")
    angular_acceleration_rad_s2: Axes = Field(
        default=Axes(), description="d_omega of (4) [rad/s^2]."
    )


class SteadyWind(Model):
    """Wind that does not change, as the velocity of the air: a wind from the west blows east."""

    north_m_s: float = quantity("m/s", ge=-100.0, le=100.0, default=0.0, doc="To the north.")
    east_m_s: float = quantity("m/s", ge=-100.0, le=100.0, default=0.0, doc="To the east.")
    down_m_s: float = quantity("m/s", ge=-100.0, le=100.0, default=0.0, doc="Downwards.")


class Shear(Model):
    """Wind that grows linearly with altitude."""

    north_1_s: float = quantity(
        "1/s", ge=-10.0, le=10.0, default=0.0, doc="Wind to the north per metre of altitude."
    )
    east_1_s: float = quantity(
        "1/s", ge=-10.0, le=10.0, default=0.0, doc="Wind to the east per metre of altitude."
    )
    altitude_m: float = quantity("m", default=0.0, doc="Altitude at which the shear adds nothing.")


class Gust(Model):
    """One gust of the form 1 - cos, for all aircraft at the same time."""

    start_s: float = quantity("s", ge=0.0, doc="Simulation time of its beginning.")
    duration_s: float = quantity("s", gt=0.0, doc="From nothing over the peak to nothing.")
    north_m_s: float = quantity("m/s", ge=-100.0, le=100.0, default=0.0, doc="Peak, to the north.")
    east_m_s: float = quantity("m/s", ge=-100.0, le=100.0, default=0.0, doc="Peak, to the east.")
    down_m_s: float = quantity("m/s", ge=-100.0, le=100.0, default=0.0, doc="Peak, downwards.")


class Dryden(Model):
    """Dryden turbulence with parameters of one's own, along the axes of the body."""

    sigma_u_m_s: float = quantity("m/s", ge=0.0, le=50.0, doc="Standard deviation along x.")
    sigma_v_m_s: float = quantity("m/s", ge=0.0, le=50.0, doc="Standard deviation along y.")
    sigma_w_m_s: float = quantity("m/s", ge=0.0, le=50.0, doc="Standard deviation along z.")
    length_u_m: float = quantity("m", ge=1.0, doc="Scale length along x.")
    length_v_m: float = quantity("m", ge=1.0, doc="Scale length along y.")
    length_w_m: float = quantity("m", ge=1.0, doc="Scale length along z.")


def _form(value: object) -> str:
    """Return the tag of parameters, or of a name."""
    return "<parameters>" if isinstance(value, dict | Dryden) else "<name>"


class Wind(Model):
    """Motion of the air; the parts add up."""

    steady: SteadyWind = Field(default=SteadyWind(), description="Wind that does not change.")
    shear: Shear = Field(default=Shear(), description="Wind that grows with altitude.")
    gust: Gust | None = Field(default=None, description="One gust.")
    turbulence: Annotated[
        Annotated[Literal["none", "light", "moderate", "severe"], Tag("<name>")]
        | Annotated[Dryden, Tag("<parameters>")],
        Discriminator(_form),
    ] = Field(
        default="none",
        description="By MIL-F-8785C at the initial altitude, or parameters of a Dryden model.",
    )
