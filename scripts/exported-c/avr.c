/* Runs the self-test on an ATmega328P in simavr, and counts: cycles of a step over the exported vectors by Timer 1, and what a step
 * takes of the stack, which is how much of a pattern below it is gone. Prints over the UART, and ends asleep with interrupts off,
 * which simavr takes for the end.
 */
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>
#include <stdio.h>

#define main selftest
#include "selftest.c"
#undef main

enum { PATTERN = 0xA5 };
extern uint8_t __heap_start;
static volatile uint16_t overflows;

ISR(TIMER1_OVF_vect) { overflows++; }

static uint32_t cycles(void)
{
    uint16_t high, low;
    do {
        high = overflows;
        low = TCNT1;
    } while (high != overflows);
    return ((uint32_t)high << 16) | low;
}

static int put(char c, FILE *file)
{
    (void)file;
    while (!(UCSR0A & _BV(UDRE0))) {
    }
    UDR0 = c;
    return 0;
}

static FILE uart = FDEV_SETUP_STREAM(put, NULL, _FDEV_SETUP_WRITE);

int main(void)
{
    static ohmstrain_state state;
    uint32_t sum = 0, most = 0;
    uint8_t *free, *top;
    int k, failed;

    UCSR0B = _BV(TXEN0);
    stdout = &uart;
    TCCR1B = _BV(CS10);
    TIMSK1 = _BV(TOIE1);
    sei();
    top = (uint8_t *)SP - 8;
    for (free = &__heap_start; free < top; free++) {
        *free = PATTERN;
    }
    ohmstrain_start(&state);
    for (k = 0; k < VECTORS; k++) {
        const vector v = vector_at(k);
        const uint32_t start = cycles();
        uint32_t taken;
        if (v.reading == v.reading) {
            ohmstrain_step(&state, v.reading, 0.0f, 0);
        } else {
            ohmstrain_predict(&state);
        }
        taken = cycles() - start;
        sum += taken;
        most = taken > most ? taken : most;
    }
    for (free = &__heap_start; *free == PATTERN; free++) {
    }
    printf("cycles a step: %lu, at most %lu; state %u B, stack %u B\n", (unsigned long)(sum / VECTORS), (unsigned long)most,
           (unsigned)sizeof state, (unsigned)(top + 8 - free));
    failed = selftest();
    cli();
    sleep_enable();
    sleep_cpu();
    return failed;
}
