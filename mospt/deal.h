/* mospt/deal.h - the order of the points that one level adds, so that every prefix is even.
 *
 * Morton order alone would draw half of a level as a half of the cube. So it is dealt out, as cards
 * are: of the hands, hand h holds points h, h + 16, h + 32 ... of the Morton order, and the hands
 * follow each other in bit-reversed order (0 8 4 12 2 ...). A whole hand, and any number of them,
 * is spread like the level itself, and begins a prefix whose density is even to a 16th of the
 * level; each hand is in Morton order still, for caches and for whoever wants to code differences.
 */
#pragma once
#include <stdint.h>

enum { MOSPT_HANDS = 16 };

typedef struct {
    uint32_t begin[MOSPT_HANDS]; /* of each hand, in the order of the level */
} mospt_deal;

/* count   points that the level adds */
static inline mospt_deal mospt_deal_of(uint32_t count)
{
    static const uint8_t turn[MOSPT_HANDS] = {0, 8, 4, 12, 2, 10, 6, 14, 1, 9, 5, 13, 3, 11, 7, 15};
    mospt_deal deal;
    for (uint32_t t = 0, begin = 0; t < MOSPT_HANDS; t++) {
        deal.begin[turn[t]] = begin;
        begin += count / MOSPT_HANDS + (turn[t] < count % MOSPT_HANDS);
    }
    return deal;
}

/* Where point k of the Morton order is. */
static inline uint32_t mospt_deal_place(const mospt_deal *deal, uint32_t k)
{
    return deal->begin[k % MOSPT_HANDS] + k / MOSPT_HANDS;
}
