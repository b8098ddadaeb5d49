/* LZF as liblzf writes it: a code below 32 copies that many bytes and one more from the packed
 * data; any other one copies from what was unpacked before, its upper 3 bits being the length (7:
 * another byte is added) less 2, the rest and one more byte the distance less 1. */
#include "preprocess/pcd.h"

#include <stdlib.h>
#include <string.h>

enum {
    PACKED_SIZE = 16 * 1024,
    CODE_MAX = 33, /* bytes of the longest code with its literals */
    SLACK = 64,    /* copies are done in steps that may go beyond */
};

bool prep_pcd_lzf_init(prep_pcd_lzf *z, prep_input *input, uint64_t offset, uint64_t size,
                       size_t piece, mospt_err *err)
{
    *z = (prep_pcd_lzf){.input = input, .offset = offset, .size = size};
    z->capacity = PREP_PCD_LZF_REACH + 2 * piece;
    z->packed = malloc(PACKED_SIZE + SLACK);
    z->out = malloc(z->capacity + PREP_PCD_LZF_STEP + SLACK);
    if (z->packed != NULL && z->out != NULL) return true;
    prep_pcd_lzf_fini(z);
    return mospt_err_nomem(err, PACKED_SIZE + z->capacity);
}

void prep_pcd_lzf_fini(prep_pcd_lzf *z)
{
    free(z->packed);
    free(z->out);
    z->packed = z->out = NULL;
}

static bool refill(prep_pcd_lzf *z, mospt_err *err)
{
    size_t kept = z->packed_end - z->packed_begin, got;
    uint64_t at = z->taken + kept, left = z->size - at;
    size_t want = left < PACKED_SIZE - kept ? (size_t)left : PACKED_SIZE - kept;
    memmove(z->packed, z->packed + z->packed_begin, kept);
    if (!prep_input_read_at(z->input, z->offset + at, z->packed + kept, want, &got, err))
        return false;
    if (got < want) z->size = at + got; /* the file has become shorter */
    z->packed_begin = 0;
    z->packed_end = kept + got;
    memset(z->packed + z->packed_end, 0, SLACK);
    return true;
}

/* Copies in steps of 16, which may write up to 15 bytes too many; they are written again later. */
static inline void copy_back(uint8_t *out, size_t distance, size_t length)
{
    const uint8_t *from = out - distance;
    if (distance >= 16) {
        for (size_t i = 0; i < length; i += 16)
            memcpy(out + i, from + i, 16);
    } else {
        for (size_t i = 0; i < length; i++)
            out[i] = from[i];
    }
}

/* Codes until `stop` is reached or the packed bytes at hand may not hold the next one. */
static void unpack(prep_pcd_lzf *z, size_t stop)
{
    const uint8_t *p = z->packed + z->packed_begin, *start = p, *end = z->packed + z->packed_end;
    uint8_t *out = z->out + z->end, *out_start = out, *out_stop = z->out + stop;
    bool is_last = z->taken + (uint64_t)(end - p) == z->size;
    /* a code that begins before this is all there, as far as it can be */
    const uint8_t *safe = is_last ? end : end - p < CODE_MAX ? p : end - (CODE_MAX - 1);
    while (out < out_stop && p < safe) {
        size_t left = (size_t)(end - p), length = p[0];
        if (length < 32) {
            length++;
            z->is_finished = left < 1 + length;
            if (z->is_finished) break;
            memcpy(out, p + 1, 32);
            p += 1 + length;
        } else {
            size_t size = length >> 5 == 7 ? 3 : 2;
            z->is_finished = left < size;
            if (z->is_finished) break;
            size_t distance = ((length & 31) << 8 | p[size - 1]) + 1;
            length = (length >> 5) + (size == 3 ? p[1] : 0) + 2u;
            z->is_broken = distance > (size_t)(out - z->out);
            if (z->is_broken) break;
            copy_back(out, distance, length);
            p += size;
        }
        out += length;
    }
    z->packed_begin += (size_t)(p - start);
    z->taken += (uint64_t)(p - start);
    z->end += (size_t)(out - out_start);
    z->made += (uint64_t)(out - out_start);
    z->is_finished = z->is_finished || z->is_broken || z->taken == z->size;
}

static bool unpack_to(prep_pcd_lzf *z, size_t stop, mospt_err *err)
{
    while (z->end < stop && !z->is_finished) {
        if (z->packed_end - z->packed_begin < CODE_MAX && !refill(z, err)) return false;
        unpack(z, stop);
    }
    return true;
}

/* Makes room behind what codes may still refer to. */
static void compact(prep_pcd_lzf *z)
{
    size_t keep = z->end > PREP_PCD_LZF_REACH ? z->end - PREP_PCD_LZF_REACH : 0;
    if (keep > z->begin) keep = z->begin;
    memmove(z->out, z->out + keep, z->end - keep);
    z->begin -= keep;
    z->end -= keep;
}

bool prep_pcd_lzf_advance(prep_pcd_lzf *z, uint64_t made, mospt_err *err)
{
    while (z->made < made && !z->is_finished) {
        z->begin = z->end;
        compact(z);
        size_t room = z->capacity - z->end;
        uint64_t left = made - z->made;
        if (!unpack_to(z, z->end + (left < room ? (size_t)left : room), err)) return false;
    }
    z->begin = z->end;
    return true;
}

void prep_pcd_lzf_save(const prep_pcd_lzf *z, prep_pcd_lzf_mark *out)
{
    size_t reach = z->end < PREP_PCD_LZF_REACH ? z->end : PREP_PCD_LZF_REACH;
    out->taken = z->taken;
    out->made = z->made;
    memcpy(out->reach, z->out + z->end - reach, reach);
}

void prep_pcd_lzf_restore(prep_pcd_lzf *z, const prep_pcd_lzf_mark *mark)
{
    size_t reach = mark->made < PREP_PCD_LZF_REACH ? (size_t)mark->made : PREP_PCD_LZF_REACH;
    memcpy(z->out, mark->reach, reach);
    z->taken = mark->taken;
    z->made = mark->made;
    z->begin = z->end = reach;
    z->packed_begin = z->packed_end = 0;
    z->is_broken = false;
    z->is_finished = z->taken >= z->size;
}

bool prep_pcd_lzf_need(prep_pcd_lzf *z, size_t size, mospt_err *err)
{
    if (z->end - z->begin >= size) return true;
    if (z->begin + size > z->capacity) compact(z);
    if (!unpack_to(z, z->begin + size, err)) return false;
    size_t have = z->end - z->begin;
    if (have < size) memset(z->out + z->end, 0, size - have);
    return true;
}

void prep_pcd_lzf_take(prep_pcd_lzf *z, size_t size)
{
    size_t have = z->end - z->begin;
    z->begin += size < have ? size : have;
}
