/* A guidance law as a shared library: it takes, corrects or replaces what the law `path` commands.
 *
 * As ftc_law.h, with the constant `ftc_guidance`, and a Python file with a subclass of
 * GuidanceParameters. It is called once in each period of guidance (`period_s`).
 */
#ifndef FTC_GUIDANCE_H
#define FTC_GUIDANCE_H

#include "ftc_law.h"

/* Slot of a formation, and corrections. */
struct ftc_coordination {
    double slot[3];      /* ahead, to the right, up, of the formation's point of the path [m] */
    double slot_rate[3]; /* [m/s] */
    double speed;        /* added to the ground speed along the path [m/s] */
    double right;        /* velocity added to the right, which keeps UAVs apart [m/s] */
    double up;           /* [m/s] */
};

struct ftc_path_point {
    double north, east; /* [m] */
    double course;      /* [rad] */
    double curvature;   /* [1/m] */
    double height;      /* [m] */
    double climb;       /* height per length */
    double airspeed;    /* [m/s] */
    int64_t leg;
};

struct ftc_guidance_input {
    double dt;              /* time since the update before [s] */
    double s;               /* path parameter [m] */
    double bandwidth;       /* of the reference filter [rad/s] */
    double command[4];      /* of `path`: airspeed [m/s], roll, pitch, yaw [rad] */
    double position[3];     /* north, east, down [m] */
    double velocity[3];     /* over ground, north, east, down [m/s] */
    double air_velocity[3]; /* through the air, north, east, down [m/s] */
    double reference[4][3]; /* filtered reference, and its first two derivatives */
    struct ftc_coordination coordination;
    struct ftc_path_point here; /* the path at s */
    struct ftc_motion motion;
};

struct ftc_guidance_output {
    double command[4]; /* what `path` commands beforehand */
};

struct ftc_guidance {
    uint32_t abi;
    uint32_t input_size, output_size, aircraft_size, parameters_size, state_size;
    int32_t (*init)(const void *parameters, void *state, const struct ftc_aircraft *aircraft);
    int32_t (*step)(const struct ftc_guidance_input *in, struct ftc_guidance_output *out,
                    const void *parameters, void *state, const struct ftc_aircraft *aircraft,
                    const void *reserved, const void *reserved_too);
};

/* FTC_GUIDANCE(struct my_parameters, sizeof(struct my_state), init, step); 0 is no state */
#define FTC_GUIDANCE(parameters, state_bytes, init, step)                                          \
    FTC_EXPORTED const struct ftc_guidance ftc_guidance = {                                        \
        FTC_LAW_ABI, sizeof(struct ftc_guidance_input), sizeof(struct ftc_guidance_output),        \
        sizeof(struct ftc_aircraft), sizeof(parameters), state_bytes, init, step}

#endif
