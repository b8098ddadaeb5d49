#include "render/json5.h"

#include <ctype.h>
#include <stdlib.h>
#include <string.h>

typedef struct {
    const char *at;
    char *out, *end; /* the copy, and where it goes on */
} converter;

static bool is_name(char c)
{
    return isalpha((unsigned char)c) || c == '_' || c == '$';
}

/* White space and comments, which become one blank. */
static void skip_blank(converter *c)
{
    for (;;) {
        if (c->at[0] == '/' && c->at[1] == '/') c->at += strcspn(c->at, "\n");
        else if (c->at[0] == '/' && c->at[1] == '*') {
            const char *end = strstr(c->at + 2, "*/");
            c->at = end != NULL ? end + 2 : c->at + strlen(c->at);
        } else if (isspace((unsigned char)*c->at)) {
            *c->end++ = *c->at == '\n' ? '\n' : ' ';
            c->at++;
        } else return;
    }
}

static void copy_text(converter *c)
{
    char quote = *c->at++;
    *c->end++ = '"';
    while (*c->at != '\0' && *c->at != quote) {
        if (*c->at == '\\' && c->at[1] == '\'') c->at++;
        else if (*c->at == '\\' && c->at[1] != '\0') *c->end++ = *c->at++;
        else if (*c->at == '"') *c->end++ = '\\';
        *c->end++ = *c->at++;
    }
    if (*c->at == quote) c->at++;
    *c->end++ = '"';
}

/* A word is a name where a colon follows, else true, false or null. */
static void copy_word(converter *c)
{
    size_t n = 0;
    while (is_name(c->at[n]) || isdigit((unsigned char)c->at[n]))
        n++;
    const char *after = c->at + n;
    while (isspace((unsigned char)*after))
        after++;
    if (*after == ':') *c->end++ = '"';
    memcpy(c->end, c->at, n);
    c->end += n;
    if (*after == ':') *c->end++ = '"';
    c->at += n;
}

/* The last comma before a bracket is dropped. */
static void copy_comma(converter *c)
{
    char *comma = c->end;
    *c->end++ = *c->at++;
    skip_blank(c);
    if (*c->at == '}' || *c->at == ']') *comma = ' ';
}

/* So that 1e5 is no word. */
static void copy_number(converter *c)
{
    if (*c->at == '+') c->at++;
    while (*c->at != '\0' && (isalnum((unsigned char)*c->at) || strchr(".+-", *c->at) != NULL))
        *c->end++ = *c->at++;
}

char *rend_json5_to_json(const char *text)
{
    /* A text of one kind of quote may need another byte for each of the other; a name two. */
    converter c = {.at = text, .out = malloc(3 * strlen(text) + 1)};
    if (c.out == NULL) return NULL;
    c.end = c.out;
    for (skip_blank(&c); *c.at != '\0'; skip_blank(&c)) {
        if (*c.at == '"' || *c.at == '\'') copy_text(&c);
        else if (is_name(*c.at)) copy_word(&c);
        else if (*c.at == ',') copy_comma(&c);
        else if (isdigit((unsigned char)*c.at) || *c.at == '-' || *c.at == '+') copy_number(&c);
        else *c.end++ = *c.at++;
    }
    *c.end = '\0';
    return c.out;
}
