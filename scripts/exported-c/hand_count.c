/* Counts the instructions of a step of a hand over its vectors, and what a step takes of the stack: see counting.h. */
#include <stdint.h>
#include <stdio.h>

#include "vectors.h"

#define PAINTED 4096
#include "counting.h"

int main(void)
{
    static ohmstrain_state state;
    volatile uint32_t *bottom;
    uint32_t all = 0, counted = 0, k;

    begin_timer();
    ohmstrain_start(&state);
    bottom = below();
    paint(bottom);
    for (k = 0; k < VECTORS; k++) {
        const uint32_t start = SYST_CVR;
        ohmstrain_step(&state, READING[k], 0);
        /* Of the steps in which no channel is left out. */
        if (k < 50) {
            all += since(start);
            counted++;
        }
    }
    printf("instructions a step: %lu; state %u B, stack %u B\n", (unsigned long)(all / counted), (unsigned)sizeof(ohmstrain_state),
           4u * unpainted(bottom));
    return 0;
}
