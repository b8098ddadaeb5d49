/* tests/ref_film.h - a film as a player sees it, frame by frame. */
#pragma once
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct {
    char codec[32];
    uint32_t width, height, count;
    uint32_t rate_num, rate_den;
    bool even;           /* every frame is at its number / rate */
    bool is_bt709_video; /* tagged with BT.709 throughout, in video range */
    bool is_sphere, is_side_by_side;
    uint8_t *rgb; /* [count * width * height * 3], owned */
} ref_film;

/* Decodes all of it; fails the test where it cannot. Released by free(film.rgb). */
ref_film ref_film_read(const char *path);
