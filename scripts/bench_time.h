/* scripts/bench_time.h - how long things take: a clock, and times in order. */
#pragma once
#include <stdint.h>

/* Of a clock that never goes back. */
double bench_now_ms(void);

/* The smallest first. */
void bench_sort(double *values, uint32_t count);
