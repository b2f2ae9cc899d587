/* An event trigger as a shared library: which channels transmit in a control step.
 *
 * As ftc_law.h, with the constant `ftc_trigger`. Beside it a Python file declares the parameters, which come
 * after a1, a2, b1 and b2, and the state:
 *
 *     class MyTrigger(TriggerParameters):
 *         LIBRARY = "my_trigger.so"
 *         nth: int = whole("", ge=1, default=7, doc="Steps between two messages.")
 *
 * Channels are aileron, elevator, rudder [rad], thrust [N].
 */
#ifndef FTC_TRIGGER_H
#define FTC_TRIGGER_H

#include "ftc_law.h"

struct ftc_trigger_input {
    double dt;           /* control period [s] */
    int64_t first;       /* 1: everything is sent, whatever the trigger says; `state` is zero then */
    int64_t selected;    /* mask of the channels that the law has selected */
    double commanded[4]; /* saturated commands */
    double held[4];      /* commands in force */
    double relative[4];  /* thresholds b1, b1, b1, a1 */
    double absolute[4];  /* thresholds b2, b2, b2 [rad], a2 [N] */
};

struct ftc_trigger_output {
    int64_t channels; /* mask of those that transmit; 0 beforehand */
};

struct ftc_trigger {
    uint32_t abi;
    uint32_t input_size, output_size, none, parameters_size, state_size;
    int32_t (*init)(const void *parameters, void *state);
    int32_t (*step)(const struct ftc_trigger_input *in, struct ftc_trigger_output *out,
                    const void *parameters, void *state);
};

/* FTC_TRIGGER(struct my_parameters, sizeof(struct my_state), init, step); 0 is no state */
#define FTC_TRIGGER(parameters, state_bytes, init, step)                                           \
    FTC_EXPORTED const struct ftc_trigger ftc_trigger = {                                          \
        FTC_LAW_ABI, sizeof(struct ftc_trigger_input), sizeof(struct ftc_trigger_output), 0,       \
        sizeof(parameters), state_bytes, init, step}

#endif
