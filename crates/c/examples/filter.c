/* Filters a recording: time and reading in two columns of a CSV file with a header, strain and its standard deviation out.
 *
 *     cc filter.c -I../include -L../../../target/release -l:libohmstrain_c.a -lm -o filter
 *     ./filter sensor.toml readings.csv
 */
#include <math.h>
#include <stdio.h>

#include "ohmstrain_c.h"

int main(int count, char **arguments)
{
    char line[256];
    double time_s, reading;
    ohmc_estimate estimate;
    int status = 0;

    if (count != 3) {
        fprintf(stderr, "expected sensor.toml readings.csv\n");
        return 2;
    }
    ohmc_sensor *sensor = ohmc_sensor_from_file(arguments[1]);
    ohmc_filter *filter = sensor ? ohmc_filter_new(sensor, NAN, NAN) : NULL;
    FILE *readings = fopen(arguments[2], "r");
    if (!filter || !readings) {
        fprintf(stderr, "%s\n", filter ? "cannot open the readings" : ohmc_error());
        return 1;
    }
    printf("time_s,strain,strain_sd,flags\n");
    while (status == 0 && fgets(line, sizeof line, readings)) {
        if (sscanf(line, "%lf,%lf", &time_s, &reading) != 2)
            continue;
        status = ohmc_filter_step(filter, time_s, reading, &estimate);
        if (status)
            fprintf(stderr, "%s\n", ohmc_error());
        else
            printf("%.17g,%.17g,%.17g,%u\n", estimate.time_s, estimate.strain, estimate.strain_sd, (unsigned)estimate.flags);
    }
    fclose(readings);
    ohmc_filter_free(filter);
    ohmc_sensor_free(sensor);
    return status;
}
