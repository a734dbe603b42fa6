/* Every input may be odd; every output must be a number, a standard deviation a positive one, and good poses bring the filter back. */
#include <math.h>
#include <stdio.h>
#include "windwrench.h"

static unsigned long long seed = 1;
static double uniform(void)
{
    seed = seed * 6364136223846793005ULL + 1442695040888963407ULL;
    return (double)(seed >> 33) / 2147483648.0;
}
static float odd(float usual)
{
    const double which = uniform();
    if (which > 0.02) return usual;
    const float values[8] = {NAN, INFINITY, -INFINITY, 1e20f, -1e30f, 3e38f, 1e-40f, 0.0f};
    return values[(int)(uniform() * 8.0)];
}
int main(void)
{
    static ww_filter f;
    ww_estimate e;
    float level[4] = {1.0f, 0.0f, 0.0f, 0.0f}, origin[3] = {0.0f, 0.0f, 1.0f};
    if (ww_init(&f, origin, level) != 0) return 1;
    for (long k = 0; k < STEPS; k++) {
        float w[4], x[3], q[4], g[3], a[3];
        const float turn = (float)uniform(), jump = uniform() < 0.01 ? 50.0f : 0.0f;
        for (int i = 0; i < 4; i++) w[i] = odd(SPEED * (float)(0.8 + 0.4 * uniform()));
        for (int i = 0; i < 3; i++) {
            x[i] = odd(jump + 0.01f * (float)uniform());
            g[i] = odd((float)uniform());
            a[i] = odd((i == 2 ? 9.81f : 0.0f) + (float)uniform());
        }
        q[0] = odd(cosf(turn)); q[1] = odd(0.0f); q[2] = odd(sinf(turn)); q[3] = odd(0.0f);
        ww_predict(&f, w, odd(uniform() < 0.01 ? 2.0f * (float)uniform() : 0.005f));
        if (uniform() < 0.9)
            ww_correct_pose(&f, uniform() < 0.05 ? 0 : x, uniform() < 0.05 ? 0 : q);
        if (k > STEPS / 2 && uniform() < 0.9)
            ww_correct_imu(&f, uniform() < 0.05 ? 0 : g, uniform() < 0.05 ? 0 : a);
        ww_get(&f, &e);
        const float *numbers = (const float *)&e;
        for (int i = 0; i < 37; i++)
            if (!isfinite(numbers[i]) || (i >= 19 && !(numbers[i] > 0.0f))) { printf("step %ld: number %d\n", k, i); return 2; }
    }
    /* good poses bring it back */
    for (int k = 0; k < 2000; k++) {
        const float w[4] = {SPEED, SPEED, SPEED, SPEED};
        ww_predict(&f, w, 0.005f);
        ww_correct_pose(&f, origin, level);
    }
    ww_get(&f, &e);
    printf("%d %.4f %.4f\n", e.status, (double)e.position[2], (double)e.quaternion[0]);
    return 0;
}
