/* Counts the instructions of a step over the exported vectors under `qemu -icount shift=0`: one nanosecond each, and the
 * board's SysTick has 25 MHz, so that one tick is 40 instructions. What a step takes of the stack is how much of a pattern
 * below it is gone.
 */
#include <stdint.h>
#include <stdio.h>

#include "vectors.h"

#define SYST_CSR (*(volatile uint32_t *)0xE000E010)
#define SYST_RVR (*(volatile uint32_t *)0xE000E014)
#define SYST_CVR (*(volatile uint32_t *)0xE000E018)

static uint32_t since(uint32_t start) { return ((start - SYST_CVR) & 0x00FFFFFFu) * 40u; }

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

enum { PAINTED = 2048 };
static const uint32_t PATTERN = 0x5EA50DE5u;

/* The stack below the caller's, of which a few words are this function's own. */
static __attribute__((noinline)) volatile uint32_t *below(void)
{
    uintptr_t stack_pointer;
    __asm__ volatile("mov %0, sp" : "=r"(stack_pointer));
    return (volatile uint32_t *)stack_pointer - PAINTED;
}

int main(void)
{
    static ohmstrain_state state;
    uint32_t alone, with_estimate;
    volatile uint32_t *bottom;
    int i;
    SYST_RVR = 0x00FFFFFFu;
    SYST_CVR = 0;
    SYST_CSR = 5;
    alone = steps(0);
    with_estimate = steps(1);
    ohmstrain_start(&state);
    ohmstrain_step(&state, state.rest_reading, 0.0f, 0);
    ohmstrain_step(&state, state.rest_reading * 1.01f, 0.0f, 0);
    bottom = below();
    for (i = 0; i < PAINTED; i++) {
        bottom[i] = PATTERN;
    }
    ohmstrain_step(&state, state.rest_reading * 1.02f, 0.0f, 0);
    for (i = 0; i < PAINTED && bottom[i] == PATTERN; i++) {
    }
    printf("instructions a step: %lu, with its estimate %lu; state %u B, stack %u B\n", (unsigned long)alone,
           (unsigned long)with_estimate, (unsigned)sizeof(ohmstrain_state), 4u * (unsigned)(PAINTED - i));
    return 0;
}
