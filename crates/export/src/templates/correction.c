/* ---- The learned correction ---------------------------------------------------------------------------------------- */

enum { ROWS = << correction.rows.count >>, INDUCING = << correction.inducing >> };
enum { STRIPES = << correction.processes[0].explained|length >> };

/* Scale of an input: mean, standard deviation and range in the rows. */
typedef struct scale_of {
    float mean, sd, lower, upper;
} scale_of;

/* Scales of the inputs, and of the features of simulated rows. */
static const scale_of INPUT_SCALE[INPUTS] = {
{% for i in range(13) %}
    {<< correction.mean[i] >>f, {% if correction.sd[i] is none %}INFINITY{% else %}<< correction.sd[i] >>f{% endif %}, << correction.lower[i] >>f, << correction.upper[i] >>f},
{% endfor %}
};
{% if correction.simulated %}
static const scale_of SIMULATED_SCALE[FEATURES] = {
{% for i in range(6, 13) %}
    {<< correction.mean[i] >>f, {% if correction.sd[i] is none %}INFINITY{% else %}<< correction.sd[i] >>f{% endif %}, << correction.simulated.lower[i] >>f, << correction.simulated.upper[i] >>f},
{% endfor %}
};
{% endif %}
/* Time constants of the low-passes, s. */
static const float TIME_CONSTANT_S[LOW_PASSES] = {<< correction.time_constants_s|join("f, ") >>f};
/* Share that they forget over the usual interval, and its mean; saves exponentials. */
static const float USUAL_DECAY[LOW_PASSES] = {<< correction.decays|join("f, ") >>f};
static const float USUAL_MEAN_DECAY[LOW_PASSES] = {<< correction.mean_decays|join("f, ") >>f};

/* Rows of the calibration: the filter's strain, rate, relaxation, baseline, probabilities of stretching and releasing; then the reading,
 * its distances from low-passes, and two rates, all standardised. The first are the inducing rows. */
static const float ROW[ROWS][INPUTS] = {
{% for row in correction.rows.one_by_one %}
    {<< row|join("f, ") >>f},
{% endfor %}
};

/* Standardised inputs, and the squared distance of each outside its range. */
static void scale_all(const float *input, const scale_of *scales, int count, float *x, float *square)
{
    int i;

    for (i = 0; i < count; i++) {
        scale(input[i], scales[i].mean, scales[i].sd, scales[i].lower, scales[i].upper, &x[i], &square[i]);
    }
}

/* Gaussian process, by weights of the rows and variance explained by inducing rows: module `correction` of the Rust crate `ohmstrain-ekf`. */
typedef struct process {
    float weight[ROWS];
    float explained[STRIPES][4]; /* An upper triangle in stripes of four rows: of each the columns from the diagonal on. */
} process;

{% for p in correction.processes %}
/* << p.comment >> */
static const process << p.name >> = {
    {<< p.weights|join("f, ") >>f},
    {{% for column in p.explained %}{<< column|join("f, ") >>f}<< ", " if not loop.last >>{% endfor %}},
};
{% endfor %}

/* Passes a relative reading, or the time without one, to the low-passes. */
static void hear(readings *seen, float dt_s, const float *rho, int surprises)
{
    const float waited_s = seen->waited_s + dt_s;
    float decay[LOW_PASSES], mean_decay[LOW_PASSES];
    int i;

    for (i = 0; i < LOW_PASSES; i++) {
        decay[i] = USUAL_DECAY[i];
        mean_decay[i] = USUAL_MEAN_DECAY[i];
        if (rho && waited_s != OHMSTRAIN_DT_S) {
            const float x = waited_s / TIME_CONSTANT_S[i];
            decay[i] = expf(-x);
            mean_decay[i] = x > 0.0f ? -expm1f(-x) / x : 1.0f;
        }
    }
    watch(seen, dt_s, rho != 0, rho ? *rho : 0.0f, surprises, decay, mean_decay);
}

/* Share of the prior variance that the inducing rows explain. */
static float explained_by(const process *p, const float kernel[INDUCING])
{
    const float (*w)[4] = p->explained;
    float explained = 0.0f;
    int i, j;

    for (i = 0; i < INDUCING; i += 4) {
        float a = 0.0f, b = 0.0f, c = 0.0f, d = 0.0f;
        for (j = i; j < INDUCING; j++, w++) {
            a += (*w)[0] * kernel[j];
            b += (*w)[1] * kernel[j];
            c += (*w)[2] * kernel[j];
            d += (*w)[3] * kernel[j];
        }
        explained += a * a;
        explained += b * b;
        explained += c * c;
        explained += d * d;
    }
    return explained;
}

{% if correction.simulated %}
enum { SIMULATED_ROWS = << correction.simulated.rows.count >> };

/* Standardised features of readings simulated by the law, and the weights of these rows. */
static const float SIMULATED_ROW[SIMULATED_ROWS][FEATURES] = {
{% for row in correction.simulated.rows.one_by_one %}
    {<< row[6:]|join("f, ") >>f},
{% endfor %}
};
static const float SIMULATED_WEIGHT[SIMULATED_ROWS] = {<< correction.simulated.process.weights|join("f, ") >>f};

{% endif %}
/* Returns the corrected strain and its variance. `filtered` is the filter's strain, clamped to the limits. */
static void correct(const summary *all, const readings *seen, float filtered, float filtered_variance, float *strain,
                    float *variance)
{
    float input[INPUTS], x[INPUTS], square[INPUTS], kernel[2][INDUCING], outside[2], predicted[2], mean[2], spread[2], novelty;
    int i, k;

    input[0] = filtered;
    input[1] = all->mean[1];
    input[2] = 0.0f;
    for (i = 2; i < 2 + OHMSTRAIN_BRANCHES; i++) {
        input[2] += all->mean[i];
    }
    input[3] = all->mean[LAST];
    input[4] = all->phase[EXTEND];
    input[5] = all->phase[RETRACT];
    for (i = 0; i < FEATURES; i++) {
        input[OUTPUTS + i] = seen->feature[i];
    }
    scale_all(input, INPUT_SCALE, INPUTS, x, square);
    of_inputs(x, square, &outside[0], &outside[1], &predicted[0], &predicted[1]);
    for (k = 0; k < ROWS; k++) {
        float of_direct, of_residual;
        kernels(x, ROW[k], &of_direct, &of_residual);
        predicted[0] += DIRECT.weight[k] * of_direct;
        predicted[1] += RESIDUAL.weight[k] * of_residual;
        if (k < INDUCING) {
            kernel[0][k] = of_direct;
            kernel[1][k] = of_residual;
        }
    }
    direct(predicted[0], explained_by(&DIRECT, kernel[0]), x[OUTPUTS], outside[0], &mean[0], &spread[0]);
    residual(predicted[1], explained_by(&RESIDUAL, kernel[1]), x[0], outside[1], filtered, filtered_variance, &mean[1],
             &spread[1], &novelty);
    mix(mean[0], spread[0], mean[1], spread[1], &mean[0], &spread[0]);
    spread[0] = learned(spread[0], novelty, birge_of(seen));
{% if correction.simulated %}
    scale_all(seen->feature, SIMULATED_SCALE, FEATURES, x, square);
    predicted[1] = << correction.simulated.process.mean >>f;
    for (k = 0; k < SIMULATED_ROWS; k++) {
        predicted[1] += SIMULATED_WEIGHT[k] * simulated_kernel(x, SIMULATED_ROW[k]);
    }
    simulated(predicted[1], x[0], simulated_distance(square), &mean[1], &spread[1]);
    mix(mean[0], spread[0], mean[1], spread[1], strain, variance);
{% else %}
    *strain = mean[0];
    *variance = spread[0];
{% endif %}
    /* Without a reading the deviation grows as that of the filter. */
    if (seen->waits && filtered_variance > seen->known_variance) {
        *variance += filtered_variance - seen->known_variance;
    }
}
