/* tests/fuzz_main.c - runs a fuzz target without a fuzzing library: random mutations of seed files.
 *
 * Usage: fuzz_FORMAT FOLDER [SECONDS [SEED]]. Takes every file in the folder as a seed, of long
 * ones the beginning, and runs for that many seconds (10). Without the folder the run is skipped.
 */
#include <dirent.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

enum { SEEDS_MAX = 256, SEED_SIZE = 64 * 1024, INPUT_SIZE = SEED_SIZE + 4096, SKIPPED = 77 };

typedef struct {
    uint8_t *bytes;
    size_t size;
} seed;

typedef struct {
    uint8_t bytes[INPUT_SIZE];
    size_t size;
} input;

static uint32_t draw(uint64_t *state, size_t limit)
{
    *state = *state * 6364136223846793005u + 1442695040888963407u;
    return limit > 0 ? (uint32_t)((*state >> 33) % limit) : 0;
}

static int load(const char *folder, seed *seeds)
{
    struct dirent **names;
    int count = 0, found = scandir(folder, &names, NULL, alphasort); /* always in the same order */
    for (int i = 0; i < found; i++) {
        char path[4096];
        snprintf(path, sizeof path, "%s/%s", folder, names[i]->d_name);
        FILE *f = names[i]->d_name[0] != '.' && count < SEEDS_MAX ? fopen(path, "rb") : NULL;
        free(names[i]);
        if (f == NULL) continue;
        seeds[count].bytes = malloc(SEED_SIZE);
        if (seeds[count].bytes == NULL) abort();
        seeds[count].size = fread(seeds[count].bytes, 1, SEED_SIZE, f);
        fclose(f);
        count++;
    }
    if (found >= 0) free(names);
    return count;
}

static void insert(input *in, size_t at, const void *bytes, size_t size)
{
    if (in->size + size > INPUT_SIZE) return;
    memmove(in->bytes + at + size, in->bytes + at, in->size - at);
    memcpy(in->bytes + at, bytes, size);
    in->size += size;
}

/* Headers are where the decisions are: most edits hit the first bytes. */
static void edit(input *in, const seed *other, uint64_t *state)
{
    static const char *const words[] = {"0",  "-1", "4294967295", "1e308",
                                        "\n", " ",  "nan",        "18446744073709551615"};
    static const uint8_t special[] = {0, 1, 0x1f, 0x20, 0x7f, 0x80, 0xe0, 0xff, '0', '9', '\n'};
    size_t reach = draw(state, 2) == 0 && in->size > 400 ? 400 : in->size;
    size_t at = draw(state, reach);
    switch (draw(state, 7)) {
    case 0:
        in->bytes[at] ^= (uint8_t)(1u << draw(state, 8));
        break;
    case 1:
        in->bytes[at] = special[draw(state, sizeof special)];
        break;
    case 2:
        in->bytes[at] = (uint8_t)draw(state, 256);
        break;
    case 3: {
        const char *word = words[draw(state, sizeof words / sizeof words[0])];
        insert(in, at, word, strlen(word));
        break;
    }
    case 4: {
        size_t n = draw(state, 40), left = in->size - at;
        if (n > left) n = left;
        memmove(in->bytes + at, in->bytes + at + n, left - n);
        in->size -= n;
        break;
    }
    case 5: {
        size_t from = draw(state, other->size), n = draw(state, 300);
        insert(in, at, other->bytes + from, n < other->size - from ? n : other->size - from);
        break;
    }
    default:
        if (draw(state, 4) == 0) in->size = draw(state, in->size);
    }
}

int main(int argc, char **argv)
{
    static seed seeds[SEEDS_MAX];
    static input in;
    double seconds = argc > 2 ? strtod(argv[2], NULL) : 10;
    uint64_t state = argc > 3 ? strtoull(argv[3], NULL, 10) : 1;
    int count = argc > 1 ? load(argv[1], seeds) : 0;
    if (count == 0) {
        printf("skipped: no seeds\n");
        return SKIPPED;
    }
    long rounds = 0;
    struct timespec start, now;
    clock_gettime(CLOCK_MONOTONIC, &start);
    do {
        const seed *s = &seeds[draw(&state, (size_t)count)];
        const seed *other = &seeds[draw(&state, (size_t)count)];
        memcpy(in.bytes, s->bytes, s->size);
        in.size = s->size;
        for (uint32_t edits = 1 + draw(&state, 6); edits > 0 && in.size > 0; edits--)
            edit(&in, other, &state);
        LLVMFuzzerTestOneInput(in.bytes, in.size);
        rounds++;
        clock_gettime(CLOCK_MONOTONIC, &now);
    } while ((double)(now.tv_sec - start.tv_sec) + 1e-9 * (double)(now.tv_nsec - start.tv_nsec) <
             seconds);
    printf("%ld inputs from %d seeds\n", rounds, count);
    for (int i = 0; i < count; i++)
        free(seeds[i].bytes);
    return 0;
}
