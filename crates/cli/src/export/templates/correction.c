/* ---- The learned correction ---------------------------------------------------------------------------------------- */

enum { INPUTS = 13, OUTPUTS = 6, FEATURES = 7, ROWS = << correction.rows.count >>, INDUCING = << correction.inducing >> };
enum { STRIPES = << correction.processes[0].explained|length >> };

/* Scales of the inputs: the filter's strain, rate, relaxation, baseline, probabilities of stretching and releasing; then
 * the reading, its distances from low-passes, and two rates. */
static const float INPUT_MEAN[INPUTS] = {<< correction.mean|join("f, ") >>f};
static const float INPUT_SD[INPUTS] = {{% for x in correction.sd %}{% if x is none %}INFINITY{% else %}<< x >>f{% endif %}<< ", " if not loop.last >>{% endfor %}};
static const float INPUT_LOWER[INPUTS] = {<< correction.lower|join("f, ") >>f};
static const float INPUT_UPPER[INPUTS] = {<< correction.upper|join("f, ") >>f};
/* Time constants of the low-passes, s, and the usual sizes of the two rates. */
static const float TIME_CONSTANT_S[LOW_PASSES] = {<< correction.time_constants_s|join("f, ") >>f};
/* What they forget over the usual interval, and its mean: exponentials are dear. */
static const float USUAL_DECAY[LOW_PASSES] = {<< correction.decays|join("f, ") >>f};
static const float USUAL_MEAN_DECAY[LOW_PASSES] = {<< correction.mean_decays|join("f, ") >>f};
/* Where they start at a first reading y: a + b y. */
static const float START[LOW_PASSES][2] = {{% for start in correction.starts %}{<< start|join("f, ") >>f}<< ", " if not loop.last >>{% endfor %}};
static const float RATE_SCALE[2] = {<< correction.rates|join("f, ") >>f};

/* Standardised inputs of rows of the calibration; the first are the inducing rows. */
static const float ROW[ROWS][INPUTS] = {
{% for row in correction.rows.one_by_one %}
    {<< row|join("f, ") >>f},
{% endfor %}
};

/* A Gaussian process: see the Rust crate `ohmstrain-ekf`, module `correction`. */
typedef struct process {
    float relevance[INPUTS]; /* 1/2l^2 with the length scale l of an input, in its standard deviations; 0: not seen */
    float mean;
    float variance;
    float noise;
    float widening;
    float least_variance;
    float weight[ROWS];
    float explained[STRIPES][4]; /* An upper triangle in stripes of four rows: of each the columns from the diagonal on. */
} process;

{% for p in correction.processes %}
/* << p.comment >> */
static const process << p.name >> = {
    {<< p.relevance|join("f, ") >>f},
    << p.mean >>f, << p.variance >>f, << p.noise >>f, << p.widening >>f, << p.least_variance >>f,
    {<< p.weights|join("f, ") >>f},
    {{% for column in p.explained %}{<< column|join("f, ") >>f}<< ", " if not loop.last >>{% endfor %}},
};
{% endfor %}

/* Takes a reading, relative, into the low-passes; without one they wait. The first few that surprise are passed over. */
static void watch(readings *seen, float dt_s, const float *rho, int surprises)
{
    float low[LOW_PASSES], scaled, fast, slow;
    int i;

    if (rho && !surprises) {
        seen->surprises = 0;
    } else if (rho && seen->surprises < << correction.passed_over >>) {
        seen->surprises++;
        rho = (const float *)0;
    }
    seen->waited_s += dt_s;
    seen->missing = rho == 0;
    if (!rho) {
        return;
    }
    scaled = clamped((*rho - << correction.centre >>f) / << correction.half_range >>f, -<< correction.farthest >>f, << correction.farthest >>f);
    for (i = 0; i < LOW_PASSES; i++) {
        if (seen->has_feature) {
            float decay = USUAL_DECAY[i], mean_decay = USUAL_MEAN_DECAY[i];
            if (seen->waited_s != OHMSTRAIN_DT_S) {
                const float x = seen->waited_s / TIME_CONSTANT_S[i];
                decay = expf(-x);
                mean_decay = x > 0.0f ? -expm1f(-x) / x : 1.0f;
            }
            seen->low_pass[i] = decay * seen->low_pass[i] + (mean_decay - decay) * seen->scaled +
                                (1.0f - mean_decay) * scaled;
        } else {
            seen->low_pass[i] = START[i][0] + START[i][1] * scaled;
        }
        low[i] = seen->low_pass[i];
    }
    seen->scaled = scaled;
    seen->waited_s = 0.0f;
    seen->has_feature = 1;
    seen->feature[0] = scaled;
    seen->feature[1] = scaled - low[1];
    seen->feature[2] = scaled - low[3];
    seen->feature[3] = scaled - low[4];
    seen->feature[4] = scaled - low[5];
    fast = low[0] - low[1];
    slow = low[2] - low[3];
    seen->feature[5] = tanhf(<< correction.rate_gain >>f * fast / RATE_SCALE[0]);
    seen->feature[6] = tanhf(<< correction.rate_gain >>f * slow / RATE_SCALE[1]);
}

{% if correction.quadratics %}
/* What stands for rows of the calibration that were left out: quadratic functions of a process' inputs, written out. */
{% for q in correction.quadratics %}
static float quadratic_of_<< correction.processes[loop.index0].name|lower >>(const float *x)
{
    float sum = 0.0f, slope;

{% for row in q.rows %}
    slope = << row.linear >>f;
{% for other in row.square %}
    slope += << other >>f * x[<< loop.index0 >>];
{% endfor %}
    sum += slope * x[<< loop.index0 >>];
{% endfor %}
    return sum;
}
{% endfor %}

{% endif %}
static float linear(float product)
{
    return << correction.linear >>f * (product + 1.0f);
}

/* What a process says of kernels: its variance, and the share of the prior that is not explained. */
static float variance_of(const process *p, const float kernel[INDUCING], float first, float least, float *unknown)
{
    const float prior = 1.0f + linear(first * first);
    const float (*w)[4] = p->explained;
    float explained = 0.0f, latent;
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
    *unknown = clamped((prior - explained) / prior, 0.0f, 1.0f);
    latent = prior * p->variance;
    return (latent > least ? latent : least) * *unknown + p->noise;
}

{% if correction.simulated %}
enum { SIMULATED_ROWS = << correction.simulated.rows.count >> };

/* Standardised features of readings that the law gave in simulated motions, what they say, and their range. */
static const float SIMULATED_ROW[SIMULATED_ROWS][FEATURES] = {
{% for row in correction.simulated.rows.one_by_one %}
    {<< row[6:]|join("f, ") >>f},
{% endfor %}
};
static const float SIMULATED_WEIGHT[SIMULATED_ROWS] = {<< correction.simulated.process.weights|join("f, ") >>f};
static const float SIMULATED_LOWER[FEATURES] = {<< correction.simulated.lower[6:]|join("f, ") >>f};
static const float SIMULATED_UPPER[FEATURES] = {<< correction.simulated.upper[6:]|join("f, ") >>f};

/* The strain, as the law has it where the sensor was not seen, and its variance. */
static float simulated(const float feature[FEATURES], float *variance)
{
    float x[FEATURES], said = << correction.simulated.process.mean >>f, outside = 0.0f;
    int i, k;

    for (i = 0; i < FEATURES; i++) {
        const float inside = clamped(feature[i], SIMULATED_LOWER[i], SIMULATED_UPPER[i]);
        const float excess = (feature[i] - inside) / INPUT_SD[OUTPUTS + i];
        outside += excess * excess * << correction.simulated.relevance >>f;
        x[i] = (inside - INPUT_MEAN[OUTPUTS + i]) / INPUT_SD[OUTPUTS + i];
    }
    for (k = 0; k < SIMULATED_ROWS; k++) {
        const float *row = SIMULATED_ROW[k];
        float sum = 0.0f;
{% for i in range(7) %}
        sum += (x[<< i >>] - row[<< i >>]) * (x[<< i >>] - row[<< i >>]) * << correction.simulated.relevance >>f;
{% endfor %}
        said += SIMULATED_WEIGHT[k] * (falling(-sum) + linear(x[0] * row[0]));
    }
    outside /= << correction.simulated.relevance >>f;
    *variance = << correction.simulated.process.noise >>f + << correction.far >>f * << correction.strain_variance >>f * outside;
    return clamped(said, OHMSTRAIN_LOWER, OHMSTRAIN_UPPER);
}

{% endif %}
/* The mixture of two, each weighted by its variance to the power -3/2; an exact one is all that counts. */
static float mixture(const float said[2], const float spread[2], float *variance)
{
    const float least = spread[1] < spread[0] ? spread[1] : spread[0];
    float share[2], total, mean;
    int i;

    for (i = 0; i < 2; i++) {
        const float ratio = least / spread[i];
        share[i] = least > 0.0f ? ratio * sqrtf(ratio) : (float)(spread[i] <= least && (i == 0 || spread[0] > least));
    }
    total = share[0] + share[1];
    share[0] /= total;
    share[1] /= total;
    mean = share[0] * said[0] + share[1] * said[1];
    *variance = share[0] * (spread[0] + (said[0] - mean) * (said[0] - mean)) +
                share[1] * (spread[1] + (said[1] - mean) * (said[1] - mean));
    return mean;
}

/* A variance that is larger by a factor, but not than that of a strain that is anywhere in the limits. */
static float more_by(float factor, float variance)
{
    const float span = OHMSTRAIN_UPPER - OHMSTRAIN_LOWER, anywhere = span * span * (1.0f / 12.0f);
    float more = variance * factor;

    more = more < anywhere ? more : anywhere;
    return more > variance ? more : variance;
}

/* The strain and its variance, corrected. `filtered` is the filter's strain, moved into the limits. */
static void correct(const summary *all, const readings *seen, float filtered, float filtered_variance, float *strain,
                    float *variance)
{
    float x[INPUTS], kernel[2][INDUCING], said[2], spread[2], unknown, outside[2] = {0.0f, 0.0f};
    float least, novelty;
    int i, k;

    x[0] = filtered;
    x[1] = all->mean[1];
    x[2] = 0.0f;
    for (i = 2; i < 2 + OHMSTRAIN_BRANCHES; i++) {
        x[2] += all->mean[i];
    }
    x[3] = all->mean[LAST];
    x[4] = all->phase[EXTEND];
    x[5] = all->phase[RETRACT];
    for (i = 0; i < FEATURES; i++) {
        x[OUTPUTS + i] = seen->feature[i];
    }
    for (i = 0; i < INPUTS; i++) {
        const float inside = clamped(x[i], INPUT_LOWER[i], INPUT_UPPER[i]);
        const float excess = (x[i] - inside) / INPUT_SD[i];
        outside[0] += excess * excess * DIRECT.relevance[i];
        outside[1] += excess * excess * RESIDUAL.relevance[i];
        x[i] = (inside - INPUT_MEAN[i]) / INPUT_SD[i];
    }
    outside[0] /= DIRECT.relevance[OUTPUTS];
    outside[1] /= RESIDUAL.relevance[0];

{% if correction.quadratics %}
    said[0] = DIRECT.mean + quadratic_of_direct(x + OUTPUTS);
    said[1] = RESIDUAL.mean + quadratic_of_residual(x);
{% else %}
    said[0] = DIRECT.mean;
    said[1] = RESIDUAL.mean;
{% endif %}
    for (k = 0; k < ROWS; k++) {
        const float *row = ROW[k];
        float square, direct = 0.0f, residual = 0.0f, k0, k1;
        /* Written out: a loop takes as long again. */
{% for i in range(13) %}
        square = (x[<< i >>] - row[<< i >>]) * (x[<< i >>] - row[<< i >>]);
{% if i >= 6 %}
        direct += square * DIRECT.relevance[<< i >>];
{% endif %}
        residual += square * RESIDUAL.relevance[<< i >>];
{% endfor %}
        k0 = falling(-direct) + linear(x[OUTPUTS] * row[OUTPUTS]);
        k1 = falling(-residual) + linear(x[0] * row[0]);
        said[0] += DIRECT.weight[k] * k0;
        said[1] += RESIDUAL.weight[k] * k1;
        if (k < INDUCING) {
            kernel[0][k] = k0;
            kernel[1][k] = k1;
        }
    }

    spread[0] = variance_of(&DIRECT, kernel[0], x[OUTPUTS], DIRECT.least_variance, &unknown);
    spread[0] = spread[0] * DIRECT.widening + << correction.far >>f * << correction.strain_variance >>f * outside[0];
    said[0] = clamped(0.0f + said[0], OHMSTRAIN_LOWER, OHMSTRAIN_UPPER);
    least = filtered_variance > RESIDUAL.least_variance ? filtered_variance : RESIDUAL.least_variance;
    spread[1] = variance_of(&RESIDUAL, kernel[1], x[0], least, &unknown);
    novelty = 1.0f - (1.0f - unknown) * falling(-outside[1] / << correction.new >>f);
    spread[1] = spread[1] * RESIDUAL.widening + << correction.far >>f * << correction.strain_variance >>f * outside[1];
    said[1] = clamped(filtered + said[1], OHMSTRAIN_LOWER, OHMSTRAIN_UPPER);

    said[0] = mixture(said, spread, &spread[0]);
    spread[0] = spread[0] * << correction.variance_factor >>f +
                << correction.novel >>f * << correction.strain_variance >>f * novelty;
    spread[0] = more_by(birge_of(seen), spread[0]);
{% if correction.simulated %}
    said[1] = simulated(seen->feature, &spread[1]);
    *strain = mixture(said, spread, variance);
{% else %}
    *strain = said[0];
    *variance = spread[0];
{% endif %}
    /* Without a reading the deviation grows as that of the filter. */
    if (seen->missing && filtered_variance > seen->known_variance) {
        *variance += filtered_variance - seen->known_variance;
    }
}

