/* ---- Arithmetic as lists ------------------------------------------------------------------------------------------- */

/* Lists of operations, four bytes each, in place of larger functions on an AVR, run by a loop: the same operations with the same results,
 * in a third of the flash. Compiled, each operation calls a function and moves its operands, which takes more flash than an Uno has.
 * -DOHMSTRAIN_LISTED=1 uses lists on other processors, =0 on none. */
#ifndef OHMSTRAIN_LISTED
#ifdef __AVR__
#define OHMSTRAIN_LISTED 1
#else
#define OHMSTRAIN_LISTED 0
#endif
#endif

#if OHMSTRAIN_LISTED
enum { REGISTERS = << lists.registers >>, LIST_END = 255 };
/* Codes of operations; up to NOT they take one operand. */
enum {
{% for name in lists.names %}
    << name >>{% if not loop.last %},{% endif %}

{% endfor %}
};

static float falling(float x);

/* Number or truth value. */
typedef union cell {
    float number;
    unsigned char truth;
} cell;

/* Operands of a list: inputs and constants; the state, numbers before truth values; constants of the step; arguments. */
typedef struct machine {
    const FLASH uint8_t *inputs;
    const FLASH float *constants;
    uint8_t first_constant, first_input;
    float *state;
    unsigned char *truths;
    const float *step;
    cell *given;
    cell registers[REGISTERS];
} machine;

static cell fetched(const machine *m, uint8_t operand)
{
    cell out = {0.0f};
    uint8_t slot;

    if (operand < m->first_constant) {
        return m->registers[operand];
    }
    if (operand < m->first_input) {
        out.number = m->constants[operand - m->first_constant];
        return out;
    }
    slot = m->inputs[operand - m->first_input];
    if (slot < 64) {
        out.number = m->state[slot];
    } else if (slot < 128) {
        out.truth = m->truths[slot - 64];
    } else if (slot < 192) {
        out.number = m->step[slot - 128];
    } else {
        out = m->given[slot - 192];
    }
    return out;
}

/* Runs a list; its results are written at the end. */
static void run_list(const FLASH uint8_t *next, const FLASH float *constants, float *state, unsigned char *truths,
                     const float *step, cell *given)
{
    machine m;
    uint8_t left;

    m.first_constant = next[0];
    m.first_input = next[1];
    m.inputs = next + 3;
    m.constants = constants;
    m.state = state;
    m.truths = truths;
    m.step = step;
    m.given = given;
    next = m.inputs + next[2];
    while (next[0] != LIST_END) {
        const uint8_t code = next[0];
        cell a, b, out = {0.0f};

        if (code <= SKIP_UNLESS) {
            const int stays = code == SKIP_UNLESS && fetched(&m, next[1]).truth;
            next += 4 + (stays ? 0 : next[2] + 256 * next[3]);
            continue;
        }
        a = fetched(&m, next[2]);
        if (code == PICK) {
            m.registers[next[1]] = fetched(&m, a.truth ? next[3] : next[4]);
            next += 5;
            continue;
        }
        b = code > NOT ? fetched(&m, next[3]) : a;
        switch (code) {
{% for case in lists.cases %}
        << case >>
{% endfor %}
        default: break;
        }
        m.registers[next[1]] = out;
        next += code > NOT ? 4 : 3;
    }
    next += 2;
    for (left = next[-1]; left > 0; left--) {
        const cell result = fetched(&m, next[0]);
        const uint8_t slot = next[1];

        if (slot < 64) {
            state[slot] = result.number;
        } else if (slot < 128) {
            truths[slot - 64] = result.truth;
        } else {
            given[slot - 192] = result;
        }
        next += 2;
    }
}
#endif

