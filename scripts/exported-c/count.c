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

static uint32_t ekf_steps(void)
{
    ohmstrain_state state;
    uint32_t start, k;
    ohmstrain_start(&state);
    start = SYST_CVR;
    for (k = 0; k < VECTORS; k++) {
        if (VECTOR[k].reading == VECTOR[k].reading) {
            ohmstrain_step(&state, VECTOR[k].reading, 0.0f, 0);
        } else {
            ohmstrain_predict(&state);
        }
    }
    return since(start);
}

int main(void)
{
    uint32_t ekf;
    SYST_RVR = 0x00FFFFFFu;
    SYST_CVR = 0;
    SYST_CSR = 5;
    ekf = ekf_steps();
    printf("instructions a step: %lu\n", (unsigned long)(ekf / VECTORS));
    return 0;
}
