/* ---- Hypotheses -------------------------------------------------------------------------------------------------- */

{% if splits %}
/* Sign of the rates in a moving phase. */
static float side_of(int phase)
{
    return phase == RETRACT ? -1.0f : 1.0f;
}

/* Truncates the rate to the sign of a moving phase; returns the probability of that sign. */
static float cut_rate(hypothesis *h, int phase)
{
    float certain;

    return is_uncertain_of_side(h->mean, h->covariance, side_of(phase), &certain)
               ? cut_off(h->mean, h->covariance, side_of(phase))
               : certain;
}

{% endif %}
/* Updates with a reading; returns true if the result is sound. */
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

/* ---- Children of a step: kept, merged, dropped ------------------------------------------------------------------- */

/* Weights are in units of the exponential of the largest exponent so far. */
typedef struct children {
    ohmstrain_mixture *kept;
    float exponent;
    float density;
    /* Sums of the innovations of all children, relative to the first. */
    float weight, around, distance, square, variance;
} children;

/* Merges with another hypothesis. */
static void merge(hypothesis *into, const hypothesis *other)
{
    const float total = into->weight + other->weight;
    float mine, theirs;

    if (!(total > 0.0f)) {
        return;
    }
    mine = into->weight / total;
    theirs = other->weight / total;
    merge_states(into->mean, into->covariance, other->mean, other->covariance, mine, theirs);
    into->weight = total;
    into->per_inside = mine * into->per_inside + theirs * other->per_inside;
}

/* Merges a child into the nearest hypothesis of its phase, except the one at `but`. A negligible child, or one without another, is
 * dropped. */
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
            const hypothesis *h = &kept->hypothesis[i];
            const float distance = distance_of(h->mean, h->covariance, child->mean, child->covariance);
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
        const float fewer = kept->count == 0 ? 1.0f : falling(all->exponent - exponent);
        for (i = 0; i < kept->count; i++) {
            kept->hypothesis[i].weight *= fewer;
        }
        all->density *= fewer;
        all->exponent = exponent;
    }
    below = exponent - all->exponent;
    likelihood = below == 0.0f || factor == 0.0f ? factor : factor * falling(below);
    all->density += likelihood;
    child->weight = likelihood * more_inside;
    for (i = 0; i < kept->count; i++) {
        hypothesis *h = &kept->hypothesis[i];
        if (h->phase == child->phase && is_like(h->mean, h->covariance, child->mean, child->covariance)) {
            merge(h, child);
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

/* Normalises the probabilities and drops negligible hypotheses; returns false if none is left. */
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

/* Updates a predicted child with the reading, if there is one, and adds it. Returns true if the result is sound. */
static int weigh(children *all, hypothesis *child, float prior, const float *rho, float extra_variance)
{
    float factor = prior, exponent = 0.0f, more_inside;

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
    of_limits(child->mean, child->covariance, child->per_inside, OHMSTRAIN_LOWER, OHMSTRAIN_UPPER, &more_inside,
              &child->per_inside);
    add(all, child, factor, exponent, more_inside);
    return 1;
}

{% if splits %}
/* Phase of a rate whose sign was left open. */
static int toward(const hypothesis *h)
{
    return h->phase == HOLD ? HOLD : h->mean[1] < 0.0f ? RETRACT : EXTEND;
}

/* Probability of phase `to` after `from`. The directions of a moving body get their probabilities by truncation, or, if the direction
 * is open, by a reading. */
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

/* Path beyond the net movement, for a rate that may change its sign within the step, and its variance. */
typedef struct turning {
    float excess;
    float variance;
} turning;

/* Adds a child of `parent` in a phase. Returns true if the result is sound. */
static int add_child(children *all, const hypothesis *parent, int phase, float probability, const turning *turns,
                     const float s[STEP], const float *rho, float extra_variance)
{
    hypothesis child = *parent;
    float *x = child.mean, *p = child.covariance;
    float prior = parent->weight * probability;
    const int moves = phase != HOLD, rests = << "parent->phase == HOLD && moves" if rests else "0" >>;

    child.phase = (unsigned char)phase;
    if (rests) {
        renew_rate(x, p, FRESH_MEAN[phase], FRESH_VARIANCE[phase]);
    }
    if (turns && moves && is_hopeless(x, p, side_of(phase), s)) {
        return 1;
    }
    if (!moves) {
        predict_hold(x, p, s);
    } else if (!rests && !turns) {
        predict_open(x, p, s);
    } else if (!rests && turns->variance > 0.0f) {
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
        /* After a hold the chain gives the probability of this direction; none of it goes to the other. */
        if (!(rests && mass > 0.5f)) {
            prior *= mass;
        }
    }
    return weigh(all, &child, prior, rho, extra_variance);
}

/* Adds all children of a hypothesis. Returns true if the results are sound. */
static int add_children(children *all, const ohmstrain_mixture *before, const hypothesis *parent, int open,
                        const float s[STEP], const float *rho, float extra_variance)
{
    turning turns = {0.0f, 0.0f};
    int phase;

    if (!open) {
        const int from = before->open ? toward(parent) : parent->phase;
        if (from != HOLD) {
            turning_of(parent->mean, parent->covariance, side_of(from), &turns.excess, &turns.variance, s);
        }
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
/* Adds all children of a hypothesis. Returns true if the results are sound. */
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
            renew_rate(child.mean, child.covariance, FRESH_MEAN[phase], FRESH_VARIANCE[phase]);
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

/* Belief: all hypotheses. */
typedef ohmstrain_mixture belief;

static void keep(const ohmstrain_state *state, belief *kept)
{
    *kept = state->mixture;
}

static void restore(ohmstrain_state *state, const belief *kept)
{
    state->mixture = *kept;
}

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

/* Initial state, at a known strain if there is one. */
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

/* Adds a hypothesis from the initial state, in place of the lightest if there is no room, so that a filter that has lost the strain can
 * find it again. */
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

/* Moments over all hypotheses. */
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
            float hazard;
            const float stretches = variance <= 0.0f ? (h->mean[1] > 0.0f ? 1.0f : 0.0f)
                                                     : tail_above((0.0f - h->mean[1]) / sqrtf(variance), &hazard);
            out->phase[EXTEND] += h->weight * stretches;
            out->phase[RETRACT] += h->weight * (1.0f - stretches);
            continue;
        }
{% endif %}
        out->phase[h->phase] += h->weight;
    }
}
