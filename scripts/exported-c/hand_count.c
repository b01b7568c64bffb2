/* Counts the instructions of a step of a hand over its vectors, and what a step takes of the stack: see count.c. */
#include <stdint.h>
#include <stdio.h>

#include "vectors.h"

#define SYST_CSR (*(volatile uint32_t *)0xE000E010)
#define SYST_RVR (*(volatile uint32_t *)0xE000E014)
#define SYST_CVR (*(volatile uint32_t *)0xE000E018)

enum { PAINTED = 4096 };
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
    volatile uint32_t *bottom;
    uint32_t all = 0, counted = 0, k;
    int i;

    SYST_RVR = 0x00FFFFFFu;
    SYST_CVR = 0;
    SYST_CSR = 5;
    ohmstrain_start(&state);
    bottom = below();
    for (i = 0; i < PAINTED; i++) {
        bottom[i] = PATTERN;
    }
    for (k = 0; k < VECTORS; k++) {
        const uint32_t start = SYST_CVR;
        ohmstrain_step(&state, READING[k], 0);
        /* Of the steps in which no channel is left out. */
        if (k < 50) {
            all += ((start - SYST_CVR) & 0x00FFFFFFu) * 40u;
            counted++;
        }
    }
    for (i = 0; i < PAINTED && bottom[i] == PATTERN; i++) {
    }
    printf("instructions a step: %lu; state %u B, stack %u B\n", (unsigned long)(all / counted), (unsigned)sizeof(ohmstrain_state),
           4u * (unsigned)(PAINTED - i));
    return 0;
}
