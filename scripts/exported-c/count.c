/* Counts the instructions of a step over the exported vectors, and what a step takes of the stack: see counting.h. */
#include <stdint.h>
#include <stdio.h>

#include "vectors.h"

#define PAINTED 2048
#include "counting.h"

/* Over all vectors; with the estimate, if asked for. Counted step by step: all of them would be too many for the timer where
 * floating point is software. */
static uint32_t steps(int asks)
{
    ohmstrain_state state;
    ohmstrain_estimate estimate;
    uint32_t all = 0, k;
    ohmstrain_start(&state);
    for (k = 0; k < VECTORS; k++) {
        const uint32_t start = SYST_CVR;
        if (VECTOR[k].reading == VECTOR[k].reading) {
            ohmstrain_step(&state, VECTOR[k].reading, 0.0f, 0);
        } else {
            ohmstrain_predict(&state);
        }
        if (asks) {
            ohmstrain_get(&state, &estimate);
        }
        all += since(start);
    }
    return all / VECTORS;
}

int main(void)
{
    static ohmstrain_state state;
    uint32_t alone, with_estimate;
    volatile uint32_t *bottom;
    begin_timer();
    alone = steps(0);
    with_estimate = steps(1);
    ohmstrain_start(&state);
    ohmstrain_step(&state, state.rest_reading, 0.0f, 0);
    ohmstrain_step(&state, state.rest_reading * 1.01f, 0.0f, 0);
    bottom = below();
    paint(bottom);
    ohmstrain_step(&state, state.rest_reading * 1.02f, 0.0f, 0);
    printf("instructions a step: %lu, with its estimate %lu; state %u B, stack %u B\n", (unsigned long)alone,
           (unsigned long)with_estimate, (unsigned)sizeof(ohmstrain_state), 4u * unpainted(bottom));
    return 0;
}
