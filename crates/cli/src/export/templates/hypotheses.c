/* ---- The normal distribution ------------------------------------------------------------------------------------- */

/* Rational approximations of W. J. Cody, Math. Comp. 23 (1969) 631. */
static float polynomial(const float *coefficient, int count, float x)
{
    float sum = 0.0f;
    int i;

    for (i = 0; i < count; i++) {
        sum = sum * x + coefficient[i];
    }
    return sum;
}

/* Argument below whose square erf is taken, and the constants of the tails. */
static const float NEAR_ZERO = 0.21972656f;
static const float ROOT_HALF = 0.70710677f, PER_ROOT_TWO_PI = 0.3989423f, ROOT_TWO_PER_PI = 0.7978846f;
static const float ROOT_PER_PI = 0.5641896f;

/* erf(x) / x for small squares. */
static float near_zero(float square)
{
    static const float above[5] = {1.857777061846031526730e-1f, 3.161123743870565597f, 1.138641541510501556e2f,
                                   3.774852376853020208e2f, 3.209377589138469472562e3f};
    static const float below[5] = {1.0f, 2.360129095234412094e1f, 2.440246379344441733e2f, 1.282616526077372276e3f,
                                   2.844236833439170622e3f};
    return polynomial(above, 5, square) / polynomial(below, 5, square);
}

/* exp(x^2) erfc(x) for x from 0.47 on. */
static float scaled_tail(float x, float square)
{
    static const float above[9] = {2.15311535474403846e-8f, 5.64188496988670089e-1f, 8.88314979438837594f,
                                   6.61191906371416295e1f, 2.98635138197400131e2f, 8.81952221241769090e2f,
                                   1.71204761263407058e3f, 2.05107837782607147e3f, 1.23033935479799725e3f};
    static const float below[9] = {1.0f, 1.57449261107098347e1f, 1.17693950891312499e2f, 5.37181101862009858e2f,
                                   1.62138957456669019e3f, 3.29079923573345963e3f, 4.36261909014324716e3f,
                                   3.43936767414372164e3f, 1.23033935480374942e3f};
    static const float far_above[6] = {1.63153871373020978e-2f, 3.05326634961232344e-1f, 3.60344899949804439e-1f,
                                       1.25781726111229246e-1f, 1.60837851487422766e-2f, 6.58749161529837803e-4f};
    static const float far_below[6] = {1.0f, 2.56852019228982242f, 1.87295284992346725f, 5.27905102951428412e-1f,
                                       6.05183413124413191e-2f, 2.33520497626869185e-3f};
    float w, less;

    if (!(x > 4.0f)) {
        return polynomial(above, 9, x) / polynomial(below, 9, x);
    }
    w = 1.0f / square;
    less = w * polynomial(far_above, 6, w) / polynomial(far_below, 6, w);
    return (ROOT_PER_PI - less) / x;
}

/* What is above a border: its probability, and the density at the border over it. */
static float tail_above(float border, float *hazard)
{
    const float x = border * ROOT_HALF, square = x * x, falls = expf(-square);
    const float density = falls * PER_ROOT_TWO_PI;
    float mass, scaled, beyond;

    if (square < NEAR_ZERO) {
        mass = 0.5f - 0.5f * x * near_zero(square);
        *hazard = density / mass;
        return mass;
    }
    scaled = scaled_tail(x < 0.0f ? -x : x, square);
    beyond = 0.5f * falls * scaled;
    if (x < 0.0f) {
        mass = 1.0f - beyond;
        *hazard = density / mass;
        return mass;
    }
    *hazard = ROOT_TWO_PER_PI / scaled;
    return beyond;
}

static float upper_tail(float x)
{
    float hazard;

    return tail_above(x, &hazard);
}

/* ---- Hypotheses -------------------------------------------------------------------------------------------------- */

{% if splits %}
/* Where the rate may turn around on the way: path beyond the net move's, and its variance. */
typedef struct turning {
    float excess;
    float variance;
} turning;

/* Of a rate, positive away from zero: how often it turns around is told by its density at zero. */
static turning turning_of(float rate, float rate_variance, float expected, float spread, float noise)
{
    const turning none = {0.0f, 0.0f};
    float per_sd, u, square, cut, gaussian, density, even, total, change_sd, thinner, evenly;
    turning out;

    if (!(rate_variance > 0.0f) || (rate > 0.0f && rate * rate > << turning.clear >>f * rate_variance)) {
        return none;
    }
    per_sd = 1.0f / sqrtf(rate_variance);
    u = rate * per_sd;
    square = u > 1.0f ? u * u : 1.0f;
    cut = expf(1.0f - square);
    gaussian = << turning.normal_density >>f * expf(-0.5f * square);
    density = (cut > gaussian ? cut : gaussian) * per_sd;
    even = expected < 0.0f ? expected * expected : 0.0f;
    total = noise + even + spread;
    change_sd = sqrtf(total);
    thinner = 1.0f + << turning.reach >>f * change_sd * per_sd;
    evenly = << turning.even_excess >>f * (even + 0.5f * spread);
    out.excess = density * (evenly + << turning.brownian_excess >>f * noise);
    out.variance = << turning.brownian_variance >>f * density * total * change_sd / thinner;
    return out;
}

/* Restricts the rate to the sign of a moving phase; what that leaves of the hypothesis. */
static float cut_rate(hypothesis *h, int phase)
{
    const float variance = h->covariance[AT(1, 1)], side = phase == RETRACT ? -1.0f : 1.0f;
    const float toward = side * h->mean[1];
    float per_sd, border, mass, shift, narrowed;

    if (variance <= 0.0f) {
        return toward < 0.0f ? 0.0f : 1.0f;
    }
    if (toward > 0.0f && toward * toward > CLEAR_TAIL * variance) {
        return 1.0f;
    }
    per_sd = 1.0f / sqrtf(variance);
    border = -toward * per_sd;
    mass = tail_above(border, &shift);
    narrowed = border * shift - shift * shift;
    narrowed = narrowed > 0.0f ? 0.0f : narrowed < -1.0f ? -1.0f : narrowed;
    regress(h->mean, h->covariance, side * shift * per_sd, narrowed * per_sd * per_sd);
    return mass;
}

/* Whether next to nothing of a prediction has the sign of a moving phase. */
static int is_hopeless(const hypothesis *h, int phase, const float s[STEP])
{
    float mean, variance, toward;

    if (phase == EXTEND) {
        rate_ahead_extend(h->mean, h->covariance, &mean, &variance, s);
    } else {
        rate_ahead_retract(h->mean, h->covariance, &mean, &variance, s);
    }
    toward = phase == RETRACT ? -mean : mean;
    return toward < 0.0f && toward * toward > << hopeless >>f * variance;
}

{% endif %}
/* Draws the rate anew, independent of everything else. */
static void renew_rate(hypothesis *h, int phase)
{
    int i;

    h->mean[1] = FRESH_MEAN[phase];
    h->covariance[AT(1, 0)] = 0.0f;
    h->covariance[AT(1, 1)] = FRESH_VARIANCE[phase];
    for (i = 2; i < STATES; i++) {
        h->covariance[AT(i, 1)] = 0.0f;
    }
}

/* Takes a reading; returns whether all is sound. */
static int take(hypothesis *h, float rho, float extra_variance, float *innovation, float *variance, float *nis)
{
    float *x = h->mean, *p = h->covariance;

    switch (h->phase) {
    case EXTEND:
        return take_extend(x, p, rho, extra_variance, innovation, variance, nis);
    case RETRACT:
        return take_retract(x, p, rho, extra_variance, innovation, variance, nis);
    default:
        return take_hold(x, p, rho, extra_variance, innovation, variance, nis);
    }
}

/* Probability of the limits where a tail counts; what has left them altogether is no less likely than a least one. */
static float inside_limits(float strain, float variance)
{
    const float above_lower = strain - OHMSTRAIN_LOWER, below_upper = OHMSTRAIN_UPPER - strain;
    const float reach = CLEAR_TAIL * variance;
    float per_sd, near, far, beyond_far, inside;

    if (variance <= 0.0f || (above_lower > 0.0f && above_lower * above_lower > reach && below_upper > 0.0f &&
                             below_upper * below_upper > reach)) {
        return 1.0f;
    }
    per_sd = 1.0f / sqrtf(variance);
    near = above_lower < below_upper ? above_lower : below_upper;
    far = above_lower < below_upper ? below_upper : above_lower;
    beyond_far = far > 0.0f && far * far > reach ? 0.0f : upper_tail(far * per_sd);
    inside = near > 0.0f ? 1.0f - (upper_tail(near * per_sd) + beyond_far) : upper_tail(-near * per_sd) - beyond_far;
    return inside > LEAST_INSIDE ? inside : LEAST_INSIDE;
}

/* ---- Children of a step: kept, merged, dropped ------------------------------------------------------------------- */

/* Weights are in units of the exponential of the largest exponent so far. */
typedef struct children {
    ohmstrain_mixture *kept;
    float exponent;
    float density;
    /* The reading compared with all predictions of it, around the first. */
    float weight, around, distance, square, variance;
} children;

/* Squared distance of two states, in units of the larger variance. */
static float apart(const hypothesis *a, const hypothesis *b, int i)
{
    const float difference = a->mean[i] - b->mean[i];
    const float mine = a->covariance[AT(i, i)], theirs = b->covariance[AT(i, i)];

    return difference == 0.0f ? 0.0f : difference * difference / (theirs > mine ? theirs : mine);
}

static float distance_of(const hypothesis *a, const hypothesis *b)
{
    return apart(a, b, 0) + apart(a, b, 1);
}

static int is_like(const hypothesis *a, const hypothesis *b)
{
    const float difference = a->mean[0] - b->mean[0];
    float strain;

    if (a->phase != b->phase ||
        difference * difference > ALIKE * (a->covariance[AT(0, 0)] + b->covariance[AT(0, 0)])) {
        return 0;
    }
    strain = apart(a, b, 0);
    return strain < ALIKE && strain + apart(a, b, 1) < ALIKE;
}

/* Takes another hypothesis in, with the mean and covariance of the pair. */
static void merge(hypothesis *into, const hypothesis *other)
{
    const float total = into->weight + other->weight;
    float mine, theirs, both, difference[STATES];
    int i, j;

    if (!(total > 0.0f)) {
        return;
    }
    mine = into->weight / total;
    theirs = other->weight / total;
    both = mine * theirs;
    for (i = 0; i < STATES; i++) {
        difference[i] = other->mean[i] - into->mean[i];
        into->mean[i] += difference[i] * theirs;
    }
    for (i = 0; i < STATES; i++) {
        for (j = 0; j <= i; j++) {
            into->covariance[AT(i, j)] = mine * into->covariance[AT(i, j)] + theirs * other->covariance[AT(i, j)] +
                                         both * difference[i] * difference[j];
        }
    }
    into->weight = total;
    into->per_inside = mine * into->per_inside + theirs * other->per_inside;
}

/* Merges a child into the nearest of its phase but that at `but`; without one, or negligible, it is dropped. */
static void merge_into_nearest(ohmstrain_mixture *kept, const hypothesis *child, int but)
{
    float heaviest = child->weight, least = 0.0f;
    int i, nearest = -1;

    for (i = 0; i < kept->count; i++) {
        heaviest = kept->hypothesis[i].weight > heaviest ? kept->hypothesis[i].weight : heaviest;
    }
    if (child->weight < heaviest * LEAST_WEIGHT) {
        return;
    }
    for (i = 0; i < kept->count; i++) {
        if (i != but && kept->hypothesis[i].phase == child->phase) {
            const float distance = distance_of(&kept->hypothesis[i], child);
            if (nearest < 0 || distance < least) {
                nearest = i;
                least = distance;
            }
        }
    }
    if (nearest >= 0) {
        merge(&kept->hypothesis[nearest], child);
    }
}

/* Adds a child, whose weight is factor * exp(exponent) * more_inside. */
static void add(children *all, hypothesis *child, float factor, float exponent, float more_inside)
{
    ohmstrain_mixture *kept = all->kept;
    float likelihood, below;
    int i, lightest = 0;

    if (kept->count == 0 || exponent > all->exponent) {
        const float fewer = kept->count == 0 ? 1.0f : expf(all->exponent - exponent);
        for (i = 0; i < kept->count; i++) {
            kept->hypothesis[i].weight *= fewer;
        }
        all->density *= fewer;
        all->exponent = exponent;
    }
    below = exponent - all->exponent;
    likelihood = below == 0.0f || factor == 0.0f ? factor : factor * expf(below);
    all->density += likelihood;
    child->weight = likelihood * more_inside;
    for (i = 0; i < kept->count; i++) {
        if (is_like(&kept->hypothesis[i], child)) {
            merge(&kept->hypothesis[i], child);
            return;
        }
    }
    if (kept->count < OHMSTRAIN_HYPOTHESES) {
        kept->hypothesis[kept->count++] = *child;
        return;
    }
    for (i = 1; i < kept->count; i++) {
        lightest = kept->hypothesis[i].weight < kept->hypothesis[lightest].weight * NOT_LIGHTER ? i : lightest;
    }
    if (kept->hypothesis[lightest].weight < child->weight * NOT_LIGHTER) {
        const hypothesis displaced = kept->hypothesis[lightest];
        merge_into_nearest(kept, &displaced, lightest);
        kept->hypothesis[lightest] = *child;
    } else {
        merge_into_nearest(kept, child, -1);
    }
}

/* Makes the probabilities sum to one and drops what is negligible; whether anything is left. */
static int normalise(ohmstrain_mixture *kept)
{
    float heaviest = 0.0f, sum = 0.0f, per_sum;
    int i, count = 0;

    for (i = 0; i < kept->count; i++) {
        heaviest = kept->hypothesis[i].weight > heaviest ? kept->hypothesis[i].weight : heaviest;
    }
    for (i = 0; i < kept->count; i++) {
        if (kept->hypothesis[i].weight > heaviest * LEAST_WEIGHT) {
            if (count < i) {
                kept->hypothesis[count] = kept->hypothesis[i];
            }
            count++;
        }
    }
    kept->count = count;
    for (i = 0; i < count; i++) {
        sum += kept->hypothesis[i].weight;
    }
    if (!(sum > 0.0f && isfinite(sum))) {
        return 0;
    }
    per_sum = 1.0f / sum;
    for (i = 0; i < count; i++) {
        kept->hypothesis[i].weight *= per_sum;
    }
    return 1;
}

/* Gives a predicted child the reading, if there is one, and adds it. Returns whether all is sound. */
static int weigh(children *all, hypothesis *child, float prior, const float *rho, float extra_variance)
{
    float factor = prior, exponent = 0.0f, more_inside, inside;

    if (rho) {
        float innovation, variance, nis, distance;
        if (!take(child, *rho, extra_variance, &innovation, &variance, &nis) || !(variance > 0.0f)) {
            return 0;
        }
{% if tempering is none %}
        factor = prior / sqrtf(variance);
        exponent = -0.5f * nis;
{% else %}
        exponent = << tempering >>f * (nis + logf(variance));
{% endif %}
        if (all->weight == 0.0f) {
            all->around = innovation;
        }
        distance = innovation - all->around;
        all->weight += prior;
        all->distance += prior * distance;
        all->square += prior * distance * distance;
        all->variance += prior * variance;
    } else if (!is_sound(child->mean, child->covariance)) {
        return 0;
    }
    inside = inside_limits(child->mean[0], child->covariance[AT(0, 0)]);
    more_inside = inside == 1.0f ? child->per_inside : inside * child->per_inside;
    child->per_inside = inside == 1.0f ? inside : 1.0f / inside;
    add(all, child, factor, exponent, more_inside);
    return 1;
}

{% if splits %}
/* The phase of a rate that was left open; what holds has none. */
static int toward(const hypothesis *h)
{
    return h->phase == HOLD ? HOLD : h->mean[1] < 0.0f ? RETRACT : EXTEND;
}

/* Probability that `to` follows `from`. Whether a moving body stretches or releases is for the cut to say, or, where the
 * direction stays open, for a reading. */
static float follows(int from, int to, int open, const float chain[PHASES * PHASES])
{
{% if rests %}
    if (from == HOLD) {
        return chain[PHASES * HOLD + to];
    }
    if (to == HOLD) {
        return chain[PHASES * EXTEND + HOLD];
    }
    return open && to != from ? 0.0f : 1.0f - chain[PHASES * EXTEND + HOLD];
{% else %}
    (void)chain;
    if (to == HOLD) {
        return 0.0f;
    }
    return open && to != (from == RETRACT ? RETRACT : EXTEND) ? 0.0f : 1.0f;
{% endif %}
}

/* A child of `parent` in a phase. Returns whether all is sound. */
static int add_child(children *all, const hypothesis *parent, int phase, float probability, const turning *turns,
                     const float s[STEP], const float *rho, float extra_variance)
{
    hypothesis child = *parent;
    float *x = child.mean, *p = child.covariance;
    float prior = parent->weight * probability;
    const int moves = phase != HOLD, rests = << "parent->phase == HOLD && moves" if rests else "0" >>;

    child.phase = (unsigned char)phase;
    if (rests) {
        renew_rate(&child, phase);
    }
    if (turns && moves && is_hopeless(&child, phase, s)) {
        return 1;
    }
    if (!moves) {
        predict_hold(x, p, s);
    } else if (!rests && !turns) {
        predict_open(x, p, s);
    } else if (!rests && parent->phase != HOLD && turns->variance > 0.0f) {
        if (phase == EXTEND) {
            predict_extend_turning(x, p, turns->excess, turns->variance, s);
        } else {
            predict_retract_turning(x, p, turns->excess, turns->variance, s);
        }
    } else if (phase == EXTEND) {
        predict_extend(x, p, s);
    } else {
        predict_retract(x, p, s);
    }
    if (turns && moves) {
        const float mass = cut_rate(&child, phase);
        if (!(mass > LEAST_MASS)) {
            return 1;
        }
        /* After a hold the chain has said how likely this direction is; none of it goes to the other. */
        if (!(rests && mass > 0.5f)) {
            prior *= mass;
        }
    }
    return weigh(all, &child, prior, rho, extra_variance);
}

/* All children of a hypothesis. Returns whether all is sound. */
static int add_children(children *all, const ohmstrain_mixture *before, const hypothesis *parent, int open,
                        const float s[STEP], const float *rho, float extra_variance)
{
    turning turns = {0.0f, 0.0f};
    int phase;

    if (!open) {
        const int from = before->open ? toward(parent) : parent->phase;
        const float side = from == RETRACT ? -1.0f : 1.0f;
        float expected, spread;
        if (from == RETRACT) {
            rate_change_retract(parent->mean, parent->covariance, &expected, &spread, s);
        } else {
            rate_change_extend(parent->mean, parent->covariance, &expected, &spread, s);
        }
        turns = turning_of(side * parent->mean[1], parent->covariance[AT(1, 1)], expected, spread, s[NOISE_2]);
    }
    for (phase = 0; phase < PHASES; phase++) {
        const float probability = follows(parent->phase, phase, open, s + CHAIN);
        if (probability > 0.0f &&
            !add_child(all, parent, phase, probability, open ? (const turning *)0 : &turns, s, rho, extra_variance)) {
            return 0;
        }
    }
    return 1;
}
{% else %}
/* All children of a hypothesis. Returns whether all is sound. */
static int add_children(children *all, const hypothesis *parent, const float s[STEP], const float *rho,
                        float extra_variance)
{
    int phase;

    for (phase = 0; phase < PHASES; phase++) {
        hypothesis child = *parent;
        const float probability = s[CHAIN + PHASES * parent->phase + phase];
        if (!(probability > 0.0f)) {
            continue;
        }
        child.phase = (unsigned char)phase;
        if (phase != HOLD && parent->phase != phase) {
            renew_rate(&child, phase);
        }
        if (phase == HOLD) {
            predict_hold(child.mean, child.covariance, s);
        } else if (phase == EXTEND) {
            predict_extend(child.mean, child.covariance, s);
        } else {
            predict_retract(child.mean, child.covariance, s);
        }
        if (!weigh(all, &child, parent->weight * probability, rho, extra_variance)) {
            return 0;
        }
    }
    return 1;
}
{% endif %}

/* One interval on, with a reading or without. *state changes only if everything went well, and if the innovation's square is
 * no more than `most` times its variance, which SURPRISED says. */
static int attempt(ohmstrain_state *state, const interval *over, const float *rho, float extra_variance, float most,
                   ohmstrain_residual *residual)
{
    const ohmstrain_mixture *before = &state->mixture;
    ohmstrain_mixture next;
    children all = {0, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f};
    int i;
{% if splits %}
    const float pause_s = rho ? 0.0f : before->pause_s + over->step_s;
{% if forgets_s is none %}
    const int open = 0;
{% else %}
    const int open = pause_s > << forgets_s >>f;
{% endif %}
{% endif %}

    all.kept = &next;
    next.count = 0;
    for (i = 0; i < before->count; i++) {
        const hypothesis *parent = &before->hypothesis[i];
        if (!add_children(&all, << "before, parent, open" if splits else "parent" >>, over->numbers, rho, extra_variance)) {
            return OHMSTRAIN_ERR_STATE;
        }
    }
    if (!normalise(&next)) {
        return OHMSTRAIN_ERR_STATE;
    }
{% if splits %}
    next.pause_s = pause_s;
    next.open = (unsigned char)open;
{% endif %}
    if (rho) {
        const float mean = all.distance / all.weight, spread = all.square / all.weight - mean * mean;
        residual->innovation = all.around + mean;
        residual->variance = all.variance / all.weight + (spread > 0.0f ? spread : 0.0f);
        residual->nis = residual->innovation * residual->innovation / residual->variance;
        if (residual->nis > most) {
            return SURPRISED;
        }
    }
    state->mixture = next;
    return OHMSTRAIN_OK;
}

/* Before any reading; at a strain that is known if there is one. */
static void start_hypothesis(hypothesis *first, const float *strain)
{
    int i, j;

    for (i = 0; i < STATES; i++) {
        first->mean[i] = START_MEAN[i];
        for (j = 0; j < i; j++) {
            first->covariance[AT(i, j)] = 0.0f;
        }
        first->covariance[AT(i, i)] = START_VARIANCE[i];
    }
    if (strain) {
        first->mean[0] = *strain;
        first->covariance[0] = KNOWN_VARIANCE;
    }
    first->weight = 1.0f;
    first->per_inside = 1.0f;
    first->phase = << "EXTEND" if splits else "HOLD" >>;
}

static void start_mixture(ohmstrain_state *state, const float *strain)
{
    start_hypothesis(&state->mixture.hypothesis[0], strain);
    state->mixture.count = 1;
{% if splits %}
    state->mixture.pause_s = 0.0f;
    state->mixture.open = 0;
{% endif %}
}

/* Follows what was known before any reading, too, in place of the lightest hypothesis if there is no other: where a filter has
 * lost its way, that finds it. */
static void look_again(ohmstrain_state *state)
{
    ohmstrain_mixture *all = &state->mixture;
    float total = 0.0f, left;
    int i, place = 0;

    if (all->count < OHMSTRAIN_HYPOTHESES) {
        place = all->count++;
    } else {
        for (i = 1; i < all->count; i++) {
            place = all->hypothesis[i].weight < all->hypothesis[place].weight ? i : place;
        }
    }
    start_hypothesis(&all->hypothesis[place], (const float *)0);
    all->hypothesis[place].weight = 0.0f;
    for (i = 0; i < all->count; i++) {
        total += all->hypothesis[i].weight;
    }
    left = (1.0f - BESIDE_SHARE) / total;
    for (i = 0; i < all->count; i++) {
        all->hypothesis[i].weight *= left;
    }
    all->hypothesis[place].weight = BESIDE_SHARE;
}

/* What all hypotheses say together. */
static void summarise(const ohmstrain_state *state, summary *out)
{
    const ohmstrain_mixture *all = &state->mixture;
    int i, k;

    for (i = 0; i < STATES; i++) {
        out->mean[i] = 0.0f;
        for (k = 0; k < all->count; k++) {
            out->mean[i] += all->hypothesis[k].mean[i] * all->hypothesis[k].weight;
        }
    }
    for (i = 0; i < 2; i++) {
        out->variance[i] = 0.0f;
        for (k = 0; k < all->count; k++) {
            const hypothesis *h = &all->hypothesis[k];
            const float difference = h->mean[i] - out->mean[i];
            out->variance[i] = out->variance[i] + h->covariance[AT(i, i)] * h->weight;
            out->variance[i] += h->weight * difference * difference;
        }
    }
    for (i = 0; i < PHASES; i++) {
        out->phase[i] = 0.0f;
    }
    for (k = 0; k < all->count; k++) {
        const hypothesis *h = &all->hypothesis[k];
{% if splits %}
        if (all->open && h->phase != HOLD) {
            const float variance = h->covariance[AT(1, 1)];
            const float stretches = variance <= 0.0f ? (h->mean[1] > 0.0f ? 1.0f : 0.0f)
                                                     : upper_tail((0.0f - h->mean[1]) / sqrtf(variance));
            out->phase[EXTEND] += h->weight * stretches;
            out->phase[RETRACT] += h->weight * (1.0f - stretches);
            continue;
        }
{% endif %}
        out->phase[h->phase] += h->weight;
    }
}
