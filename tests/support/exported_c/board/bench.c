/* Flies the exported filter along the flight in flight.h on a Cortex-M4F, and says what it estimates,
   how many instructions each call took and how much stack. Output and end go through semihosting. */
#include <stdint.h>
#include <string.h>

#include "flight.h"
#include "windwrench.h"

extern uint32_t _data, _data_end, _data_from, _bss, _bss_end, _stack_top;

#define SYSTICK ((volatile uint32_t *)0xE000E010u) /* control, reload, value */
#define PAINT 0xA5A5A5A5u
#define PAINTED 8192 /* words below the stack pointer */
#define INSTRUCTIONS(ticks) ((ticks) * 5u / 8u) /* at 64 ns an instruction and 40 ns a tick */

static ww_filter filter;
#ifdef WW_POLICY_PERIOD
static ww_policy_memory policy;
#endif

static int semihost(int operation, const void *argument)
{
    register int r0 __asm__("r0") = operation;
    register const void *r1 __asm__("r1") = argument;
    __asm__ volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

static void say_word(uint32_t word)
{
    char text[10];
    for (int i = 0; i < 8; i++) {
        text[i] = "0123456789abcdef"[(word >> (28 - 4 * i)) & 15u];
    }
    text[8] = ' ';
    text[9] = 0;
    semihost(4, text);
}

static void say_float(float value)
{
    uint32_t word;
    memcpy(&word, &value, sizeof word);
    say_word(word);
}

static uint32_t since(uint32_t before)
{
    return (before - SYSTICK[2]) & 0xFFFFFFu;
}

/* 2,000 instructions and a few: what the timer is checked with */
static void __attribute__((noinline)) known_loop(void)
{
    __asm__ volatile("mov r2, #1000\n1: subs r2, r2, #1\n bne 1b\n" : : : "r2", "cc");
}

static void paint(void)
{
    volatile uint32_t here = 0;
    for (volatile uint32_t *word = &here - 64; word > &here - PAINTED; word--) {
        *word = PAINT;
    }
}

static uint32_t __attribute__((noinline)) painted_over(void)
{
    volatile uint32_t here = 0;
    const volatile uint32_t *word = &here - PAINTED + 64;
    while (word < &here && *word == PAINT) {
        word++;
    }
    return (uint32_t)((uintptr_t)&here - (uintptr_t)word);
}

static void fly(void)
{
    ww_estimate e;
    uint32_t before;
    SYSTICK[1] = 0xFFFFFFu;
    SYSTICK[2] = 0;
    SYSTICK[0] = 5; /* on, the processor's clock */
    before = SYSTICK[2];
    known_loop();
    semihost(4, "loop ");
    say_word(since(before));
    semihost(4, "\nsize ");
    say_word(sizeof(ww_filter));
    semihost(4, "\n");
#ifdef WW_POLICY_PERIOD
    uint32_t longest = 0;
    ww_policy_init(&policy);
#endif
    paint();
    (void)ww_init(&filter, flight[0] + 5, flight[0] + 8);
    for (int k = 1; k < FLIGHT_STEPS; k++) {
        uint32_t ticks[3] = {0, 0, 0};
        const float *row = flight[k];
        before = SYSTICK[2];
        (void)ww_predict(&filter, row + 1, row[0]);
        ticks[0] = since(before);
        before = SYSTICK[2];
        (void)ww_correct_pose(&filter, row + 5, row + 8);
        ticks[1] = since(before);
#ifdef FLIGHT_IMU
        before = SYSTICK[2];
        (void)ww_correct_imu(&filter, row + 12, row + 15);
        ticks[2] = since(before);
#endif
        ww_get(&filter, &e);
#ifdef WW_POLICY_PERIOD
        if (k % 16 == 0) {
            before = SYSTICK[2];
            (void)ww_policy(&policy, &e);
            before = since(before);
            longest = before > longest ? before : longest;
        }
#endif
        semihost(4, "step ");
        for (int i = 0; i < 3; i++) {
            say_word(INSTRUCTIONS(ticks[i]));
        }
        say_word((uint32_t)e.status);
        for (int i = 0; i < 19; i++) { /* position to force, as they stand in the estimate */
            say_float(((const float *)&e)[i]);
        }
        semihost(4, "\n");
    }
    semihost(4, "stack ");
    say_word(painted_over());
#ifdef WW_POLICY_PERIOD
    semihost(4, "\npolicy ");
    say_word(INSTRUCTIONS(longest));
    semihost(4, "\npolicysize ");
    say_word(sizeof(ww_policy_memory));
#endif
    semihost(4, "\nend\n");
    semihost(0x18, (const void *)0x20026); /* the application ends */
}

void start(void)
{
    *(volatile uint32_t *)0xE000ED88u |= 0xFu << 20; /* the floating-point unit */
    __asm__ volatile("dsb\nisb");
    memcpy(&_data, &_data_from, (size_t)((uintptr_t)&_data_end - (uintptr_t)&_data));
    memset(&_bss, 0, (size_t)((uintptr_t)&_bss_end - (uintptr_t)&_bss));
    fly();
    for (;;) {
    }
}

static void fault(void)
{
    semihost(4, "fault\n");
    semihost(0x18, (const void *)0x20023);
}

__attribute__((section(".vectors"), used)) static void *const vectors[16] = {
    &_stack_top, (void *)start, (void *)fault, (void *)fault, (void *)fault, (void *)fault, (void *)fault,
};
