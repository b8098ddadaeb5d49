/* Several frames become one. */
#include "render/cpu/lanes.h"

void RCPU_NAME(merge)(int64_t *const *frames, uint32_t frame_count, size_t from, size_t count);

void RCPU_NAME(merge)(int64_t *const *frames, uint32_t frame_count, size_t from, size_t count)
{
    enum { PART = 512 }; /* stays in the first cache while the frames pass by */
    for (size_t part = from; part < from + count; part += PART) {
        size_t end = part + PART < from + count ? part + PART : from + count;
        int64_t *restrict all = frames[0];
        for (uint32_t f = 1; f < frame_count; f++) {
            int64_t *restrict one = frames[f];
            for (size_t i = part; i < end; i++) {
                all[i] = one[i] < all[i] ? one[i] : all[i];
                one[i] = RCPU_EMPTY;
            }
        }
    }
}
