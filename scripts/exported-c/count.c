/* Counts the instructions of a step over the exported vectors under `qemu -icount shift=0`: one nanosecond each, and the
 * board's SysTick has 25 MHz, so that one tick is 40 instructions.
 */
#include <stdint.h>
#include <stdio.h>

#include "vectors.h"

#define SYST_CSR (*(volatile uint32_t *)0xE000E010)
#define SYST_RVR (*(volatile uint32_t *)0xE000E014)
#define SYST_CVR (*(volatile uint32_t *)0xE000E018)

static uint32_t since(uint32_t start) { return ((start - SYST_CVR) & 0x00FFFFFFu) * 40u; }

/* Over all vectors; with the estimate, if asked for. */
static uint32_t steps(int asks)
{
    ohmstrain_state state;
    ohmstrain_estimate estimate;
    uint32_t start, k;
    ohmstrain_start(&state);
    start = SYST_CVR;
    for (k = 0; k < VECTORS; k++) {
        if (VECTOR[k].reading == VECTOR[k].reading) {
            ohmstrain_step(&state, VECTOR[k].reading, 0.0f, 0);
        } else {
            ohmstrain_predict(&state);
        }
        if (asks) {
            ohmstrain_get(&state, &estimate);
        }
    }
    return since(start) / VECTORS;
}

int main(void)
{
    uint32_t alone, with_estimate;
    SYST_RVR = 0x00FFFFFFu;
    SYST_CVR = 0;
    SYST_CSR = 5;
    alone = steps(0);
    with_estimate = steps(1);
    printf("instructions a step: %lu, with its estimate %lu; state %u B\n", (unsigned long)alone,
           (unsigned long)with_estimate, (unsigned)sizeof(ohmstrain_state));
    return 0;
}
