/* One filter, and the numbers that go into it and come out of it, for a host that shares its memory */
#include "windwrench_filter.h"

typedef unsigned long size;
void *memcpy(void *to, const void *from, size bytes)
{
    for (size i = 0; i < bytes; i++) {
        ((char *)to)[i] = ((const char *)from)[i];
    }
    return to;
}
void *memset(void *to, int value, size bytes)
{
    for (size i = 0; i < bytes; i++) {
        ((volatile char *)to)[i] = (char)value;
    }
    return to;
}

static ww_filter filter;
static ww_estimate estimate;
static float given[12]; /* dt, rotor speeds, position, quaternion */

float *inputs(void) { return given; }
ww_estimate *outputs(void) { return &estimate; }
int start(void) { return ww_init(&filter, given + 5, given + 8); }
int step(void)
{
    int said = ww_predict(&filter, given + 1, given[0]);
    const int taken = ww_correct_pose(&filter, given + 5, given + 8);
    ww_get(&filter, &estimate);
    return said != 0 ? said : taken;
}
