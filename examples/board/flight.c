/* The exported filter and its laws, flown by what comes in: on a Cortex-M4F under qemu through semihosting,
   elsewhere through standard input and output. A step is 25 numbers: rotor speeds (4) rad/s, position (3) m,
   quaternion (4), specific force (3) m/s2, reference (10) of ww_fly, and its law; -1 begins a flight at the pose.
   The answer is the rotor speeds (4) rad/s. */
#include "windwrench.h"

#define NUMBERS 25

static ww_filter filter;
static ww_flight flight;

static void fly(const float *in, float *out)
{
    if (in[24] < 0) {
        (void)ww_init(&filter, in + 4, in + 7);
        ww_flight_init(&flight);
        return;
    }
    (void)ww_predict(&filter, in, WW_NOMINAL_PERIOD);
    (void)ww_correct_pose(&filter, in + 4, in + 7);
    (void)ww_fly(&flight, &filter, (int)in[24], in + 14, in + 11, out);
}

#ifdef __arm__
#include <stdint.h>
#include <string.h>

extern uint32_t _data, _data_end, _data_from, _bss, _bss_end, _stack_top;

static uint32_t semihost(uint32_t operation, const void *argument)
{
    register uint32_t r0 __asm__("r0") = operation;
    register const void *r1 __asm__("r1") = argument;
    __asm__ volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

/* Open a file of the machine that runs qemu to read (1) or to write (5) */
static uint32_t opened(const char *path, uint32_t mode)
{
    const uintptr_t open[3] = {(uintptr_t)path, mode, strlen(path)};
    return semihost(1, open);
}

static void __attribute__((noinline)) serve(void)
{
    float in[NUMBERS], out[4] = {0};
    const uint32_t input = opened("/dev/stdin", 1), output = opened("/dev/stdout", 5);
    for (;;) {
        for (uint32_t left = sizeof in; left > 0;) {
            const uintptr_t read[3] = {input, (uintptr_t)in + sizeof in - left, left};
            const uint32_t missing = semihost(6, read);
            if (missing == left) { /* the input has ended, and so does the program */
                (void)semihost(0x18, (const void *)0x20026);
            }
            left = missing;
        }
        fly(in, out);
        const uintptr_t write[3] = {output, (uintptr_t)out, sizeof out};
        (void)semihost(5, write);
    }
}

void start(void)
{
    *(volatile uint32_t *)0xE000ED88u |= 0xFu << 20; /* the floating-point unit */
    __asm__ volatile("dsb\nisb");
    memcpy(&_data, &_data_from, (size_t)((uintptr_t)&_data_end - (uintptr_t)&_data));
    memset(&_bss, 0, (size_t)((uintptr_t)&_bss_end - (uintptr_t)&_bss));
    serve();
}

__attribute__((section(".vectors"), used)) static void *const vectors[16] = {&_stack_top, (void *)start};
#else
#include <stdio.h>

int main(void)
{
    float in[NUMBERS], out[4] = {0};
    while (fread(in, sizeof in, 1, stdin) == 1) {
        fly(in, out);
        if (fwrite(out, sizeof out, 1, stdout) != 1 || fflush(stdout) != 0) {
            return 1;
        }
    }
    return 0;
}
#endif
