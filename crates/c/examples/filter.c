/* Filters a recording: time and reading in two columns of a CSV file with a header, strain and its standard deviation out. A row without
 * a reading is a missing one.
 *
 *     cc filter.c -I../include ../lib/libohmstrain_c.a -lm -lpthread -ldl -o filter
 *     ./filter sensor.toml readings.csv
 */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "ohmstrain_c.h"

/* Filters all rows after the header. */
static int filter_rows(ohmc_filter *filter, FILE *readings)
{
    char line[256];
    double time_s, reading;
    ohmc_estimate estimate;

    for (int number = 1; fgets(line, sizeof line, readings); number++) {
        if (number == 1)
            continue;
        const int cells = sscanf(line, "%lf,%lf", &time_s, &reading);
        if (cells < 1 || !strchr(line, '\n')) {
            fprintf(stderr, "line %d: expected a time and a reading\n", number);
            return 1;
        }
        if (ohmc_filter_step(filter, time_s, cells == 2 ? reading : NAN, &estimate)) {
            fprintf(stderr, "line %d: %s\n", number, ohmc_error());
            return 1;
        }
        printf("%.17g,%.17g,%.17g,%u\n", estimate.time_s, estimate.strain, estimate.strain_sd, (unsigned)estimate.flags);
    }
    return ferror(readings) != 0;
}

int main(int count, char **arguments)
{
    if (count != 3) {
        fprintf(stderr, "expected sensor.toml readings.csv\n");
        return 2;
    }
    ohmc_sensor *sensor = ohmc_sensor_from_file(arguments[1]);
    ohmc_filter *filter = sensor ? ohmc_filter_new(sensor, NAN, NAN) : NULL;
    FILE *readings = fopen(arguments[2], "r");
    int status = 1;

    if (!filter) {
        fprintf(stderr, "%s\n", ohmc_error());
    } else if (!readings) {
        perror(arguments[2]);
    } else {
        printf("time_s,strain,strain_sd,flags\n");
        status = filter_rows(filter, readings);
    }
    if (readings)
        fclose(readings);
    ohmc_filter_free(filter);
    ohmc_sensor_free(sensor);
    return status;
}
