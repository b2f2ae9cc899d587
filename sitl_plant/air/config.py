"""Configuration of the air: disturbances, steady wind, shear, one gust, and turbulence."""

from typing import Annotated, Literal

from pydantic import Discriminator, Tag

from mavlink_defs.config.models import Model
from mavlink_defs.config.quantity import quantity


class Sinusoid(Model):
    """sin * sin(rate t) + cos * cos(rate t), in the unit of the disturbance it belongs to.

    Attributes:
        sin: Amplitude of the sine.
        cos: Amplitude of the cosine.
        rate_rad_s: Angular frequency; 0: constant.
    """

    sin: float = quantity("", default=0.0)
    cos: float = quantity("", default=0.0)
    rate_rad_s: float = quantity("rad/s", ge=0.0)


_NONE = Sinusoid(rate_rad_s=0.0)


class Axes(Model):
    """One sinusoid for each body axis.

    Attributes:
        x: Along x, forward.
        y: Along y, to the right.
        z: Along z, down.
    """

    x: Sinusoid = _NONE
    y: Sinusoid = _NONE
    z: Sinusoid = _NONE


class Disturbance(Model):
    """Disturbances d_v and d_omega of eqs. (2) and (4), functions of simulation time.

    Attributes:
        acceleration_m_s2: d_v of (2) [m/s^2].
        angular_acceleration_rad_s2: d_omega of (4) [rad/s^2].
    """

    acceleration_m_s2: Axes = Axes()
    angular_acceleration_rad_s2: Axes = Axes()


class SteadyWind(Model):
    """Wind that does not change, as the velocity of the air: a wind from the west blows east.

    Attributes:
        north_m_s: To the north.
        east_m_s: To the east.
        down_m_s: Downwards.
    """

    north_m_s: float = quantity("m/s", default=0.0, ge=-100.0, le=100.0)
    east_m_s: float = quantity("m/s", default=0.0, ge=-100.0, le=100.0)
    down_m_s: float = quantity("m/s", default=0.0, ge=-100.0, le=100.0)


class Shear(Model):
    """Wind that grows linearly with altitude.

    Attributes:
        north_1_s: Wind to the north per metre of altitude.
        east_1_s: Wind to the east per metre of altitude.
        altitude_m: Altitude at which the shear adds nothing.
    """

    north_1_s: float = quantity("1/s", default=0.0, ge=-10.0, le=10.0)
    east_1_s: float = quantity("1/s", default=0.0, ge=-10.0, le=10.0)
    altitude_m: float = quantity("m", default=0.0)


class Gust(Model):
    """One gust of the form 1 - cos, for all aircraft at the same time.

    Attributes:
        start_s: Simulation time of its beginning.
        duration_s: From nothing over the peak to nothing.
        north_m_s: Peak, to the north.
        east_m_s: Peak, to the east.
        down_m_s: Peak, downwards.
    """

    start_s: float = quantity("s", ge=0.0)
    duration_s: float = quantity("s", gt=0.0)
    north_m_s: float = quantity("m/s", default=0.0, ge=-100.0, le=100.0)
    east_m_s: float = quantity("m/s", default=0.0, ge=-100.0, le=100.0)
    down_m_s: float = quantity("m/s", default=0.0, ge=-100.0, le=100.0)


class Dryden(Model):
    """Dryden turbulence with parameters of one's own, along the axes of the body.

    Attributes:
        sigma_u_m_s: Standard deviation along x.
        sigma_v_m_s: Standard deviation along y.
        sigma_w_m_s: Standard deviation along z.
        length_u_m: Scale length along x.
        length_v_m: Scale length along y.
        length_w_m: Scale length along z.
    """

    sigma_u_m_s: float = quantity("m/s", ge=0.0, le=50.0)
    sigma_v_m_s: float = quantity("m/s", ge=0.0, le=50.0)
    sigma_w_m_s: float = quantity("m/s", ge=0.0, le=50.0)
    length_u_m: float = quantity("m", ge=1.0)
    length_v_m: float = quantity("m", ge=1.0)
    length_w_m: float = quantity("m", ge=1.0)


def _form(value: object) -> str:
    """Return the tag of parameters, or of a name."""
    return "<parameters>" if isinstance(value, dict | Dryden) else "<name>"


class Wind(Model):
    """Motion of the air; the parts add up.

    Attributes:
        steady: Wind that does not change.
        shear: Wind that grows with altitude.
        gust: One gust.
        turbulence: By MIL-F-8785C at the initial altitude, or parameters of a Dryden model.
    """

    steady: SteadyWind = SteadyWind()
    shear: Shear = Shear()
    gust: Gust | None = None
    turbulence: Annotated[
        Annotated[Literal["none", "light", "moderate", "severe"], Tag("<name>")]
        | Annotated[Dryden, Tag("<parameters>")],
        Discriminator(_form),
    ] = "none"
