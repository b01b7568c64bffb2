/* Counting of instructions and of the stack under `qemu -icount shift=0`: one nanosecond each, and the board's SysTick has 25 MHz, so
 * that one tick is 40 instructions. What a step takes of the stack is how much of a pattern below it is gone. PAINTED, the number of
 * words of that pattern, is defined before this file is included.
 */
#include <stdint.h>

#define SYST_CSR (*(volatile uint32_t *)0xE000E010)
#define SYST_RVR (*(volatile uint32_t *)0xE000E014)
#define SYST_CVR (*(volatile uint32_t *)0xE000E018)

static const uint32_t PATTERN = 0x5EA50DE5u;

static inline void begin_timer(void)
{
    SYST_RVR = 0x00FFFFFFu;
    SYST_CVR = 0;
    SYST_CSR = 5;
}

static inline uint32_t since(uint32_t start) { return ((start - SYST_CVR) & 0x00FFFFFFu) * 40u; }

/* The stack below the caller's, of which a few words are this function's own. */
static __attribute__((noinline)) volatile uint32_t *below(void)
{
    uintptr_t stack_pointer;
    __asm__ volatile("mov %0, sp" : "=r"(stack_pointer));
    return (volatile uint32_t *)stack_pointer - PAINTED;
}

/* Always inline: a frame of its own would lie in what it paints. */
static inline __attribute__((always_inline)) void paint(volatile uint32_t *bottom)
{
    int i;
    for (i = 0; i < PAINTED; i++) {
        bottom[i] = PATTERN;
    }
}

/* Number of words from the first one that is no longer painted on. */
static inline unsigned unpainted(const volatile uint32_t *bottom)
{
    int i;
    for (i = 0; i < PAINTED && bottom[i] == PATTERN; i++) {
    }
    return (unsigned)(PAINTED - i);
}
