#include "tests/write_laz_coder.h"

#include "tests/write_las.h"

#include <stdlib.h>
#include <string.h>

void write_laz_append(write_laz_bytes *b, const void *p, size_t size)
{
    if (b->size + size > b->capacity) {
        b->capacity = 2 * (b->size + size);
        b->p = realloc(b->p, b->capacity);
        if (b->p == NULL) abort();
    }
    if (size > 0) memcpy(b->p + b->size, p, size);
    b->size += size;
}

void write_laz_append_u32(write_laz_bytes *b, uint32_t v)
{
    uint8_t p[4];
    write_las_u32(p, v);
    write_laz_append(b, p, 4);
}

static write_laz_model *all_models;

static void distribute(write_laz_model *m)
{
    uint32_t sum = 0, scale = 0x80000000u / m->total;
    for (uint32_t i = 0; i < m->symbols; sum += m->count[i++])
        m->low[i] = scale * sum >> 16;
}

static write_laz_model *make_model(uint32_t symbols)
{
    write_laz_model *m = calloc(1, sizeof *m);
    if (m == NULL) abort();
    m->next = all_models;
    all_models = m;
    m->symbols = m->total = symbols;
    m->cycle = m->left = (symbols + 6) / 2;
    for (uint32_t i = 0; i < symbols; i++)
        m->count[i] = 1;
    distribute(m);
    return m;
}

void write_laz_free_models(void)
{
    while (all_models != NULL) {
        write_laz_model *next = all_models->next;
        free(all_models);
        all_models = next;
    }
}

void write_laz_begin(write_laz_coder *c)
{
    c->out.size = 0;
    c->base = 0;
    c->length = 0xffffffffu;
    c->is_needed = false;
}

static void raise_base(write_laz_coder *c, uint32_t by)
{
    uint32_t base = c->base + by;
    if (base < by) {
        size_t i = c->out.size;
        while (c->out.p[--i] == 255)
            c->out.p[i] = 0;
        c->out.p[i]++;
    }
    c->base = base;
}

static void put_due_bytes(write_laz_coder *c)
{
    for (; c->length < 1u << 24; c->length <<= 8, c->base <<= 8) {
        uint8_t top = (uint8_t)(c->base >> 24);
        write_laz_append(&c->out, &top, 1);
    }
}

void write_laz_end(write_laz_coder *c)
{
    static const uint8_t zeros[3] = {0};
    bool one_more = c->length > 2u << 24;
    raise_base(c, one_more ? 1u << 24 : 1u << 23);
    c->length = one_more ? 1u << 23 : 1u << 15;
    put_due_bytes(c);
    write_laz_append(&c->out, zeros, one_more ? 3 : 2);
}

void write_laz_symbol(write_laz_coder *c, write_laz_model **slot, uint32_t symbols, uint32_t symbol)
{
    if (*slot == NULL) *slot = make_model(symbols);
    write_laz_model *m = *slot;
    uint32_t unit = c->length >> 15, low = m->low[symbol] * unit;
    c->length = symbol + 1 == symbols ? c->length - low : m->low[symbol + 1] * unit - low;
    raise_base(c, low);
    put_due_bytes(c);
    m->count[symbol]++;
    if (--m->left > 0) return;
    m->total += m->cycle;
    if (m->total > 32768) {
        m->total = 0;
        for (uint32_t i = 0; i < symbols; i++)
            m->total += m->count[i] = (m->count[i] + 1) / 2;
    }
    distribute(m);
    m->cycle = 5 * m->cycle / 4 < 8 * (symbols + 6) ? 5 * m->cycle / 4 : 8 * (symbols + 6);
    m->left = m->cycle;
}

void write_laz_bits(write_laz_coder *c, uint32_t bits, uint32_t value)
{
    if (bits > 19) {
        write_laz_bits(c, 16, value & 65535);
        value >>= 16;
        bits -= 16;
    }
    c->length >>= bits;
    raise_base(c, value * c->length);
    put_due_bytes(c);
}

void write_laz_bits_64(write_laz_coder *c, uint64_t value)
{
    write_laz_bits(c, 32, (uint32_t)value);
    write_laz_bits(c, 32, (uint32_t)(value >> 32));
}

static void put_one_bit(write_laz_coder *c, write_laz_number *n, uint32_t bit)
{
    if (!n->is_begun) {
        n->is_begun = true;
        n->zeros = 1, n->total = 2, n->part = 4096, n->cycle = n->left = 4;
    }
    uint32_t zero = n->part * (c->length >> 13);
    if (bit) {
        raise_base(c, zero);
        c->length -= zero;
    } else {
        c->length = zero;
        n->zeros++;
    }
    put_due_bytes(c);
    if (--n->left > 0) return;
    n->total += n->cycle;
    if (n->total > 8192) {
        n->total = (n->total + 1) / 2;
        n->zeros = (n->zeros + 1) / 2;
        if (n->zeros == n->total) n->total++;
    }
    n->part = 0x80000000u / n->total * n->zeros >> 18;
    n->cycle = n->left = 5 * n->cycle / 4 < 64 ? 5 * n->cycle / 4 : 64;
}

void write_laz_integer(write_laz_coder *c, write_laz_number *n, uint32_t bits,
                       write_laz_model **context, uint32_t predicted, uint32_t real)
{
    int64_t correction = (int32_t)(real - predicted);
    if (bits < 32) {
        int64_t range = INT64_C(1) << bits;
        correction = (int64_t)(uint32_t)((real - predicted) & (uint32_t)(range - 1));
        if (correction >= range / 2) correction -= range;
    }
    uint64_t size = (uint64_t)(correction <= 0 ? -correction : correction - 1);
    for (n->k = 0; size >> n->k != 0;)
        n->k++;
    write_laz_symbol(c, context, bits + 1, n->k);
    if (n->k == 0) put_one_bit(c, n, (uint32_t)correction);
    if (n->k == 0 || n->k == 32) return;
    uint32_t code =
        (uint32_t)(correction < 0 ? correction + (INT64_C(1) << n->k) - 1 : correction - 1);
    uint32_t low = n->k > 8 ? n->k - 8 : 0;
    write_laz_symbol(c, &n->value[n->k], 1u << (n->k - low), code >> low);
    if (low > 0) write_laz_bits(c, low, code & ((1u << low) - 1));
}
