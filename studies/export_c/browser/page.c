/* The exported filter for JavaScript: numbers go in and out through two arrays. */
#include "windwrench_filter.h"

#define EXPORT(name) __attribute__((export_name(#name)))

static ww_filter filter;
static float in[12]; /* dt, rotor speeds, position, quaternion; NaN: not measured */
static ww_estimate out;

EXPORT(inputs) float *inputs(void) { return in; }
EXPORT(outputs) const ww_estimate *outputs(void) { return &out; }
EXPORT(start) int start(void) { return ww_init(&filter, in + 5, in + 8); }

EXPORT(step) int step(void)
{
    ww_predict(&filter, in + 1, in[0]);
    const int status = ww_correct_pose(&filter, in + 5, in + 8);
    ww_get(&filter, &out);
    return status;
}
