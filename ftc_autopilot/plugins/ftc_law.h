/* A control law as a shared library: what ftc-sitl calls once in each control step of a UAV.
 *
 * A library exports one constant, `ftc_law`, best by the macro FTC_LAW at the end of this file. Beside it
 * a Python file declares the parameters, with units and ranges, and the state:
 *
 *     class MyLaw(LawParameters):
 *         LIBRARY = "my_law.so"
 *         STATE = np.dtype([("integral", "f8")])
 *         gain: float = quantity("1/s", gt=0.0, default=2.0, doc="...")
 *
 * `gcs laws header my_law.py:MyLaw` prints both as C structs. Parameters are in SI units: a key `limit_deg`
 * is `limit_rad` here. Before the flight the version and all sizes are compared.
 *
 * All members are 8 bytes wide. Vectors are in body axes (x forward, y right, z down) unless it says otherwise;
 * channels are aileron, elevator, rudder [rad], thrust [N]; references are airspeed [m/s], roll, pitch, yaw [rad].
 * The functions are called in one thread for each UAV; one library may fly several UAVs, so it keeps nothing
 * outside `state`, which is in checkpoints, too. It must not raise signals, exit, or print in every step.
 */
#ifndef FTC_LAW_H
#define FTC_LAW_H

#include <stdint.h>

#define FTC_LAW_ABI 1

/* bits of `channels` and `due` */
#define FTC_AILERON 1
#define FTC_ELEVATOR 2
#define FTC_RUDDER 4
#define FTC_THROTTLE 8
#define FTC_ALL_CHANNELS 15

/* The nominal model's view of the air. */
struct ftc_air {
    double V;       /* airspeed [m/s] */
    double F[3];    /* force without control surfaces [N] */
    double N[3];    /* moment without control surfaces [N m] */
    double C[3][3]; /* moment per aileron, elevator, rudder [N m/rad]: C[axis][surface] */
    double B[3][3]; /* force per aileron, elevator, rudder [N/rad]: B[axis][surface] */
    double D[3];    /* force per squared elevator deflection [N/rad^2] */
};

struct ftc_motion {
    double v[3];              /* velocity through the air [m/s] */
    double phi[3];            /* roll, pitch, yaw [rad] */
    double omega[3];          /* angular velocity [rad/s] */
    double V;                 /* airspeed [m/s] */
    double V_dot;             /* from the accelerometer [m/s^2] */
    double specific_force[3]; /* [m/s^2] */
    double gravity[3];        /* [m/s^2] */
    struct ftc_air air;       /* N has the propulsion's part */
    double by_thrust[3];      /* the propulsion's part of air.N [N m] */
};

/* Errors against the reference and the neighbours, equations (31) and (32) of the paper. */
struct ftc_errors {
    double V_tilde;         /* airspeed less its reference [m/s] */
    double e[3];            /* roll, pitch, yaw less their references, in (-pi, pi] [rad] */
    double V_tilde_prime;   /* synchronisation error (31) [m/s] */
    double e_prime[3];      /* synchronisation errors (32) [rad] */
    double lambda_v;        /* lambda1 + lambda2 * sum of a_ij */
    double lambda_omega;    /* lambda3 + lambda4 * sum of a_ij */
    double V_tilde_dot_sum; /* lambda2 * sum of a_ij dV_j/dt [m/s^2] */
    double e_dot_sum[3];    /* lambda4 * sum of a_ij de_j/dt [rad/s] */
};

struct ftc_law_input {
    double t;              /* time that schedules run on [s] */
    double dt;             /* control period [s] */
    int64_t first;         /* 1 in the law's first step; `state` is zero then, or as `init` left it */
    int64_t by_bank;       /* 1: heading is held by bank, the yaw error is minus the sideslip */
    int64_t due;           /* mask of the channels that the trigger sends now by the clock */
    int64_t ahead;         /* control periods by which `motion` is ahead of `seen` */
    int64_t links;         /* the same without what is known of servos and sensors */
    int64_t after_gap;     /* 1: states before this one were lost */
    double bandwidth;      /* of the reference filter [rad/s] */
    double clock_s[4];     /* period of the trigger's clock by channel [s]; 0: no clock */
    double a[2];           /* thresholds a1, a2 [N] of the thrust, (25) */
    double b[2];           /* thresholds b1, b2 [rad] of the surfaces, (29) */
    double command[4];     /* unfiltered reference */
    double held[4];        /* commands in force, by channel */
    double filtered[4][3]; /* filtered reference, and its first two derivatives */
    struct ftc_errors errors;
    struct ftc_motion motion; /* when the commands of this step will act */
    struct ftc_motion seen;   /* as measured */
};

struct ftc_law_output {
    double delta[3];  /* aileron, elevator, rudder [rad], before saturation */
    double thrust;    /* [N] */
    int64_t channels; /* mask of those that may be sent; FTC_ALL_CHANNELS beforehand */
};

/* The nominal aircraft. Derivatives are per rad; those by rates are for p b / 2V, q c / 2V, r b / 2V, or
 * for rad/s if `per_rad_s`. */
struct ftc_aircraft {
    double m;                    /* mass [kg] */
    double S;                    /* wing area [m^2] */
    double b;                    /* span [m] */
    double c_bar;                /* mean chord [m] */
    double rho;                  /* air density [kg/m^3] */
    double g;                    /* gravity [m/s^2] */
    double J[3][3];              /* inertia [kg m^2] */
    double J_inv[3][3];          /* its inverse */
    double cL0, cL_alpha, cD0, cY_beta, cl0, cl_beta, cl_p, cl_r, cl_da, cl_dr, cm0, cm_alpha,
        cm_q, cm_de, cn0, cn_beta, cn_p, cn_r, cn_da, cn_dr, cL_q, cL_de, cD_alpha, cD_alpha2,
        cD_beta, cD_beta2, cD_de, cD_de2, cY0, cY_p, cY_r, cY_da, cY_dr;
    int64_t per_rad_s;           /* 1: derivatives by rates are per rad/s */
    double stall;                /* angle of attack of the stall [rad]; 0: none */
    double stall_sharpness;      /* [1/rad] */
    double thrust_limit;         /* [N] */
    double stops[3][2];          /* least and largest aileron, elevator, rudder [rad] */
    int64_t thrust_rows;         /* of the table of the largest thrust; 0: it is thrust_limit */
    double thrust_airspeeds[8];  /* [m/s], rising; thrust is linear in between, constant outside */
    double thrust_most[8];       /* [N] */
    double thrust_arms[3];       /* rolling, pitching, yawing moment by thrust [m] */
    double thrust_lag;           /* [s] */
};

/* What a library exports. Functions return 0; anything else, or a command that is not finite, ends the
 * control of this UAV, and its flight is lost. */
struct ftc_law {
    uint32_t abi;
    uint32_t input_size, output_size, aircraft_size, parameters_size, state_size;
    /* Called before the law's first step, also when it starts again in flight; may be NULL. `state` is zero. */
    int32_t (*init)(const void *parameters, void *state, const struct ftc_aircraft *aircraft);
    /* Called in each control step. `out` holds NaN beforehand. `reserved` is for ftc-sitl itself. */
    int32_t (*step)(const struct ftc_law_input *in, struct ftc_law_output *out, const void *parameters,
                    void *state, const struct ftc_aircraft *aircraft, void *reserved);
};

#if defined(_WIN32)
#define FTC_EXPORT __declspec(dllexport)
#else
#define FTC_EXPORT __attribute__((visibility("default")))
#endif
#ifdef __cplusplus
#define FTC_EXPORTED extern "C" FTC_EXPORT
#else
#define FTC_EXPORTED FTC_EXPORT
#endif

/* FTC_LAW(struct my_parameters, sizeof(struct my_state), init, step); a size of 0 is no state */
#define FTC_LAW(parameters, state_bytes, init, step)                                               \
    FTC_EXPORTED const struct ftc_law ftc_law = {                                                  \
        FTC_LAW_ABI, sizeof(struct ftc_law_input), sizeof(struct ftc_law_output),                  \
        sizeof(struct ftc_aircraft), sizeof(parameters), state_bytes, init, step}

#endif
