/* mospt/wide.h - loops that are compiled once for each kind of vector unit, and chosen when the
 * program is loaded. */
#pragma once

/* Sanitizers are not yet there when the choice is made. */
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__SANITIZE_ADDRESS__) &&                  \
    !defined(__SANITIZE_THREAD__)
#define MOSPT_WIDE __attribute__((target_clones("avx512f", "avx2", "default")))
#else
#define MOSPT_WIDE
#endif
