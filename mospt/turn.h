/* mospt/turn.h - sixteen rows of sixteen bytes become columns, by the vector unit: how records are
 * taken apart, and put together, where their attributes have a byte or two each. */
#pragma once
#include <stddef.h>
#include <stdint.h>
#include <string.h>

enum { MOSPT_TURN = 16 };
typedef uint8_t mospt_row __attribute__((vector_size(MOSPT_TURN)));

/* One of four steps: rows that are eight apart are put into each other. */
static inline void mospt_turn_step(const mospt_row *from, mospt_row *to)
{
    for (int i = 0; i < MOSPT_TURN / 2; i++) {
        to[2 * i] = __builtin_shufflevector(from[i], from[i + 8], 0, 16, 1, 17, 2, 18, 3, 19, 4, 20,
                                            5, 21, 6, 22, 7, 23);
        to[2 * i + 1] = __builtin_shufflevector(from[i], from[i + 8], 8, 24, 9, 25, 10, 26, 11, 27,
                                                12, 28, 13, 29, 14, 30, 15, 31);
    }
}

/* rows     [MOSPT_TURN], which are used up
 * columns  out, [MOSPT_TURN], `stride` bytes from one to the next: byte k of column i is byte i of
 *          row k */
static inline void mospt_turn(mospt_row *rows, uint8_t *columns, size_t stride)
{
    mospt_row spare[MOSPT_TURN];
    mospt_turn_step(rows, spare), mospt_turn_step(spare, rows);
    mospt_turn_step(rows, spare), mospt_turn_step(spare, rows);
    for (size_t i = 0; i < MOSPT_TURN; i++)
        memcpy(columns + i * stride, &rows[i], MOSPT_TURN);
}
