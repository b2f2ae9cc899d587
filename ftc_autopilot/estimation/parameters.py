"""Parameters of the estimator: what is neither the sensors' data nor the aircraft's."""

from typing import Any

from mavlink_defs.config.models import Model
from mavlink_defs.config.quantity import quantity, whole


def _time(default: float) -> Any:
    return quantity("s", default=default, gt=0.0, le=1000.0)


def _number(default: float) -> Any:
    return quantity("", default=default, ge=0.0, le=1000.0)


def _angle(default: float) -> Any:
    return quantity("deg", default=default, gt=0.0, le=90.0)


class EstimatorParameters(Model):
    """Parameters of the estimator of every UAV, in flights by an estimated state.

    Names in brackets are PX4's for the same in EKF2, with its default in the same unit
    (https://docs.px4.io/main/en/advanced_config/tuning_the_ecl_ekf.html). With the defaults here,
    the faults of `scenarios/sensor_faults` are found, and no healthy sensor is excluded:
    `benchmarks/by_sensors.py` and `benchmarks/consistency.py` show it, and judge other values.

    Attributes:
        wind_walk_m_s_sqrt_s: Random walk of the horizontal wind [EKF2_WIND_NSD: 0.05].
        vertical_wind_m_s: Standard deviation of the vertical wind.
        vertical_wind_s: Its correlation time.
        gust_growth: Growth of the wind's noise with the excess of the pitot tube's mean NIS in
            gusts.
        gust_excess: Largest excess that counts, here and of icing in gusts.
        pitot_scale_s: Correlation time of the pitot tube's scale error: a constant would be learned
            from gusts.
        gate_sigma: Innovation test: standard deviations; a normal value exceeds 5 once in 1.7
            million [EKF2_GPS_P_GATE, EKF2_GPS_V_GATE, EKF2_BARO_GATE: 5; EKF2_MAG_GATE,
            EKF2_TAS_GATE: 3].
        take_back_sigma: The same of an excluded sensor that is to be taken back.
        sideslip_deg: Sideslip where the side force says nothing, around 0 [EKF2_BETA_NOISE: 17].
        side_disturbance_m_s2: Side force over mass of what else than sideslip makes it.
        side_model: Relative error of the coefficient of the side force.
        tilt_deg: First estimate: error of roll and pitch where gravity shows [EKF2_ANGERR_INIT:
            5.7].
        heading_deg: First estimate: error of the heading by the magnetometer [EKF2_HEAD_NOISE: 17].
        wind_m_s: First estimate: wind to be expected, each axis.
        place_m: First estimate: distance from the origin.
        smoothing_s: Output: time constant in which it takes corrections over [EKF2_TAU_VEL: 0.25].
        rate_cutoff_hz: Output: low pass of the rates [IMU_GYRO_CUTOFF: 40].
        force_cutoff_hz: Output: low pass of the specific force [IMU_ACCEL_CUTOFF: 30].
        silent_s: Excluded: a sensor without samples for longer, and than 4 of its periods.
        same_s: Excluded: with the same noisy sample for longer.
        failed_s: Excluded: with samples that fail their test for longer, 3 at least.
        take_back_s: Taken back: when its samples have passed for so long.
        position_growth_m_s: Growth of the position's error without a GNSS receiver, when one is
            back.
        latency_error_s: Receiver: standard deviation of its latency around what it says; 0: it is
            that [EKF2_GPS_DELAY, EKF3's GPS_DELAY_MS: 0 to 0.3, 0.22 for most receivers].
        receiver_memory_s: Place against velocity of a receiver: what moved alone is forgotten after
            it.
        receiver_believed_s: What moved alone and stays there is believed after it [EKF2: 7,
            reset_timeout_max].
        wind_return_s: Without a receiver: time constant of the wind's return to its mean.
        imu_silent_s: Excluded: an IMU without samples for longer.
        imu_same: Excluded: an IMU with more equal samples in a row.
        imu_noise: Excluded: an IMU whose samples have more than so many times their variance.
        imu_apart_deg_s: Two IMUs differ: angular velocity, and 1 % of it [EKF2_SEL_IMU_RAT: 7].
        imu_apart_m_s2: Two IMUs differ: specific force, and 1 % of it [EKF2_SEL_IMU_ACC: 1].
        imu_decide_s: Two IMUs differ: one is excluded after so long, at last.
        imu_take_back_s: Taken back: an IMU that has been well for so long.
        icing_mean_s: Icing: memory of the mean wind and of the mean lift.
        icing_change_m_s: Icing: least change of the wind along the x axis against its mean; more in
            gusts.
        icing_gusts: Icing: growth of that change's square with the excess of the mean NIS in gusts.
        icing_calm_m_s: Icing: change below which a wind is calm, and the usual NIS is learned: 2.2
            standard deviations, wind_walk sqrt(icing_mean/2) each, of a random walk about its own
            mean.
        icing_alone_m_s: Icing: change that no wind makes, whatever the lift: a gust of 12 m/s, the
            strongest of `benchmarks/sensor_attacks.py`, and the least change, rounded up.
        icing_lift: Icing: least change of the lift's airspeed, relative to what icing explains.
        icing_confirm_s: Icing: time for which both must agree.
    """

    wind_walk_m_s_sqrt_s: float = quantity("m/s/sqrt(s)", default=0.1, ge=0.0, le=10.0)
    vertical_wind_m_s: float = quantity("m/s", default=0.5, gt=0.0, le=20.0)
    vertical_wind_s: float = _time(8.0)
    gust_growth: float = _number(10.0)
    gust_excess: float = _number(5.0)
    pitot_scale_s: float = _time(30.0)
    gate_sigma: float = quantity("", default=5.0, gt=0.0, le=100.0)
    take_back_sigma: float = quantity("", default=3.0, gt=0.0, le=100.0)
    sideslip_deg: float = _angle(10.0)
    side_disturbance_m_s2: float = quantity("m/s^2", default=0.15, ge=0.0, le=10.0)
    side_model: float = _number(0.3)

    tilt_deg: float = _angle(4.0)
    heading_deg: float = _angle(6.0)
    wind_m_s: float = quantity("m/s", default=6.0, gt=0.0, le=100.0)
    place_m: float = quantity("m", default=1e4, gt=0.0, le=1e6)

    smoothing_s: float = _time(0.25)
    rate_cutoff_hz: float = quantity("Hz", default=40.0, gt=0.0)
    force_cutoff_hz: float = quantity("Hz", default=30.0, gt=0.0)

    silent_s: float = _time(0.5)
    same_s: float = _time(0.5)
    failed_s: float = _time(0.3)
    take_back_s: float = _time(1.0)
    position_growth_m_s: float = quantity("m/s", default=1.0, ge=0.0, le=100.0)

    latency_error_s: float = quantity("s", default=0.15, ge=0.0, le=1.0)
    receiver_memory_s: float = _time(20.0)
    receiver_believed_s: float = _time(60.0)
    wind_return_s: float = _time(15.0)

    imu_silent_s: float = _time(0.03)
    imu_same: int = whole("", default=30, ge=1, le=100_000)
    imu_noise: float = _number(9.0)
    imu_apart_deg_s: float = quantity("deg/s", default=1.0, gt=0.0, le=2000.0)
    imu_apart_m_s2: float = quantity("m/s^2", default=0.4, gt=0.0, le=160.0)
    imu_decide_s: float = _time(0.35)
    imu_take_back_s: float = _time(2.0)

    icing_mean_s: float = _time(15.0)
    icing_change_m_s: float = quantity("m/s", default=1.5, gt=0.0, le=100.0)
    icing_gusts: float = _number(6.0)
    icing_calm_m_s: float = quantity("m/s", default=0.6, gt=0.0, le=100.0)
    icing_alone_m_s: float = quantity("m/s", default=14.0, gt=0.0, le=100.0)
    icing_lift: float = _number(0.6)
    icing_confirm_s: float = _time(0.3)
