/* Stand-in for Zephyr's kernel.h: the declarations that examples/zephyr uses, with the signatures of Zephyr 3.7. Nothing of
 * Zephyr is compiled with it. */
#ifndef ZEPHYR_KERNEL_H
#define ZEPHYR_KERNEL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define BIT_MASK(n) ((1UL << (n)) - 1UL)

typedef struct { int64_t ticks; } k_timeout_t;
#define K_USEC(t) ((k_timeout_t){.ticks = (t)})

struct k_timer { k_timeout_t period; };
typedef void (*k_timer_expiry_t)(struct k_timer *timer);
typedef void (*k_timer_stop_t)(struct k_timer *timer);
#define K_TIMER_DEFINE(name, expiry_fn, stop_fn) \
    struct k_timer name; \
    const k_timer_expiry_t name##_expiry = expiry_fn; \
    const k_timer_stop_t name##_stop = stop_fn

void k_timer_start(struct k_timer *timer, k_timeout_t duration, k_timeout_t period);
uint32_t k_timer_status_sync(struct k_timer *timer);
uint32_t k_uptime_get_32(void);

#endif
