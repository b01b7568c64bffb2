/* Stand-ins for Zephyr: a converter that replays codes, a timer that has expired whenever it is waited for, and the simulated
 * board's console. */
#include <zephyr/kernel.h>
#include <zephyr/drivers/adc.h>
#include <zephyr/sys/printk.h>

#include <errno.h>
#include <stdarg.h>
#include <stdio.h>

#include "codes.h"

const struct device converter = {"converter"};
static unsigned periods; /* that have passed */
static uint32_t period_us;
static bool is_set_up;

bool adc_is_ready_dt(const struct adc_dt_spec *spec) { return spec->dev == &converter; }

int adc_channel_setup_dt(const struct adc_dt_spec *spec)
{
    is_set_up = spec->channel_id == 0;
    return is_set_up ? 0 : -EINVAL;
}

int adc_sequence_init_dt(const struct adc_dt_spec *spec, struct adc_sequence *seq)
{
    seq->channels = (uint32_t)1 << spec->channel_id;
    seq->resolution = spec->resolution;
    return 0;
}

int adc_read_dt(const struct adc_dt_spec *spec, const struct adc_sequence *sequence)
{
    const int code = CODES[periods - 1];
    if (!is_set_up || sequence->channels != 1 || sequence->resolution != spec->resolution || sequence->buffer_size != 2) {
        return -EINVAL;
    }
    if (code == FAILS) {
        return -ETIMEDOUT;
    }
    *(uint16_t *)sequence->buffer = (uint16_t)code;
    return 0;
}

void k_timer_start(struct k_timer *timer, k_timeout_t duration, k_timeout_t period)
{
    (void)duration;
    timer->period = period;
    period_us = (uint32_t)period.ticks;
}

uint32_t k_timer_status_sync(struct k_timer *timer)
{
    uint32_t expired = 0;
    (void)timer;
    do {
        if (periods == sizeof CODES / sizeof *CODES) {
            fflush(stdout);
            _exit(0);
        }
        expired++;
    } while (CODES[periods++] == LATE);
    return expired;
}

uint32_t k_uptime_get_32(void) { return (periods - 1) * (period_us / 1000); }

void printk(const char *fmt, ...)
{
    va_list arguments;
    va_start(arguments, fmt);
    vprintf(fmt, arguments);
    va_end(arguments);
}
