/* ohmstrain for C: strain from the resistance of a soft strain sensor, with an error bar.
 *
 * The sensor is a `sensor.toml`, read when the program runs. For a microcontroller `ohmstrain export --target c` writes one sensor's
 * filter as C source instead.
 *
 * Functions that return a pointer return NULL on failure, the others 0 on success; ohmc_error() says what was wrong. A failed call leaves
 * the filter as it was. NULL for a sensor or a filter is a failure, but for the functions that free. A sensor may be shared by threads; a
 * filter belongs to one thread at a time. Text and paths are UTF-8. For a sensor that was calibrated in degrees, read degrees for strain.
 *
 *     cc program.c -Iinclude lib/libohmstrain_c.a -lm -lpthread -ldl
 */
#ifndef OHMSTRAIN_C_H
#define OHMSTRAIN_C_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* A calibrated sensor. */
typedef struct ohmc_sensor ohmc_sensor;
/* A filter of a sensor, with its state. */
typedef struct ohmc_filter ohmc_filter;

/* Flags of an estimate, as in the column `flags` of estimates.csv. OHMC_SATURATED is for readings in a converter's codes, which this
 * library does not take. */
enum ohmc_flag {
    OHMC_MISSING = 1 << 0,
    OHMC_SATURATED = 1 << 1,
    OHMC_REJECTED = 1 << 2,
    OHMC_DOWNWEIGHTED = 1 << 3,
    OHMC_IMPLAUSIBLE = 1 << 4,
    OHMC_STUCK = 1 << 5,
    OHMC_READMITTED = 1 << 6,
    OHMC_RAMP_BORDER = 1 << 7,
    OHMC_AT_LIMIT = 1 << 8,
    OHMC_START_UP = 1 << 9,
    OHMC_RECOVERING = 1 << 10,
    OHMC_EXTRAPOLATED = 1 << 11,
    OHMC_LONG_RUN = 1 << 12,
    OHMC_REST_MOVED = 1 << 13
};

/* An estimate: the columns of estimates.csv but for the reading. Numbers that do not exist are NaN. */
typedef struct ohmc_estimate {
    double time_s;
    double strain, strain_sd;               /* within the sensor's limits; standard deviation */
    double strain_rate, strain_rate_sd;     /* 1/s */
    double relaxation, relaxation_sd;       /* relative to R0 */
    double baseline;                        /* relative to R0 */
    double settled_resistance;              /* reading after a long hold from now on, in the sensor's unit */
    double settled_resistance_sd;
    double p_extend, p_hold, p_retract;     /* NaN for estimators without phases */
    double p_beyond_border;
    double nis;                             /* NaN without a reading */
    double angle_deg, angle_sd;             /* NaN without a joint */
    uint32_t flags;                         /* of ohmc_flag */
} ohmc_estimate;

/* Version of the library, such as "0.2.0". */
const char *ohmc_version(void);

/* Message of the last call of this thread that failed; "" if none has. Valid until the next failure. */
const char *ohmc_error(void);

/* Reads a sensor from the text of a sensor.toml, or from a file. Readings have no temperature here: a sensor with an effect of
 * temperature has wider intervals. */
ohmc_sensor *ohmc_sensor_from_text(const char *toml);
ohmc_sensor *ohmc_sensor_from_file(const char *path);
void ohmc_sensor_free(ohmc_sensor *sensor);

/* Makes a filter, which does not need the sensor any more. rest_resistance: reading of the rested sensor today, in the sensor's unit;
 * NaN where it is not known. initial_strain: strain at the first row; NaN where it is not known. */
ohmc_filter *ohmc_filter_new(const ohmc_sensor *sensor, double rest_resistance, double initial_strain);
void ohmc_filter_free(ohmc_filter *filter);

/* Takes a reading in the sensor's unit at a time, s, after the last one. NaN is a missing reading. */
int ohmc_filter_step(ohmc_filter *filter, double time_s, double reading, ohmc_estimate *estimate);

/* Gives the strain at the last row, with a standard deviation, and the estimate that follows from it. Before the first row it is the
 * strain of that row, and the estimate's time is NaN. */
int ohmc_filter_know(ohmc_filter *filter, double strain, double sd, ohmc_estimate *estimate);

/* Sets the reading of the rested sensor from now on, in its unit. */
int ohmc_filter_rest_resistance(ohmc_filter *filter, double measured);

/* Estimates all rows of a recording from all of its readings. estimates has room for as many rows, and overlaps neither column. */
int ohmc_smooth(const ohmc_sensor *sensor, size_t rows, const double *time_s, const double *reading, ohmc_estimate *estimates);

#ifdef __cplusplus
}
#endif

#endif
