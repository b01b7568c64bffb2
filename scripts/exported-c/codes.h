/* Codes that a stand-in for a converter replays, one a period: CODES, which exported-c.sh writes. */
#ifndef CODES_H
#define CODES_H

#include "replayed_codes.h"

enum {
    FAILS = -1, /* the conversion fails */
    LATE = -2   /* the program is busy: its step comes a period later */
};

/* Leaves the simulated board. */
void _exit(int status);

#endif
