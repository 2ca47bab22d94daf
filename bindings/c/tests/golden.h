/* Reads the table of golden digests and computes the light of its rows, for the tests in C and C++. */
#ifndef GOLDEN_H
#define GOLDEN_H

#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { GOLDEN_READOUTS = 200, GOLDEN_MOST = 64 };

typedef struct {
    char *camera, *fnv1a, *light, *name;
} golden_row;

typedef struct {
    size_t count;
    golden_row rows[GOLDEN_MOST];
    char *text;
} golden_table;

static void golden_fail(const char *what) {
    fprintf(stderr, "golden table: %s\n", what);
    exit(1);
}

/* Decodes in place the JSON string whose first character is at `at`; returns the position after the closing quote. */
static char *golden_string(char *at, char **value) {
    char *to = at;
    *value = at;
    while (*at != '"') {
        if (*at == 0) golden_fail("a string does not end");
        if (*at != '\\') {
            *to++ = *at++;
            continue;
        }
        at++;
        if (*at == 'n') *to++ = '\n';
        else if (*at == 't') *to++ = '\t';
        else if (*at == '"' || *at == '\\' || *at == '/') *to++ = *at;
        else golden_fail("this reader does not support an escape sequence");
        at++;
    }
    *to = 0;
    return at + 1;
}

/* Reads an array of objects whose values are strings. */
static void golden_read(const char *path, golden_table *table) {
    FILE *file = fopen(path, "rb");
    if (!file) golden_fail("cannot be opened");
    fseek(file, 0, SEEK_END);
    long size = ftell(file);
    rewind(file);
    memset(table, 0, sizeof *table);
    table->text = (char *)malloc((size_t)size + 1);
    if (!table->text || fread(table->text, 1, (size_t)size, file) != (size_t)size) golden_fail("cannot be read");
    fclose(file);
    table->text[size] = 0;
    golden_row *row = NULL;
    for (char *at = table->text; *at; at++) {
        if (*at == '{') {
            if (table->count == GOLDEN_MOST) golden_fail("the table exceeds the maximum number of rows");
            row = &table->rows[table->count++];
        } else if (*at == '"' && row) {
            char *key, *value;
            char *next = strchr(golden_string(at + 1, &key), '"');
            if (!next) golden_fail("a key without a value");
            at = golden_string(next + 1, &value) - 1;
            if (!strcmp(key, "camera")) row->camera = value;
            else if (!strcmp(key, "fnv1a")) row->fnv1a = value;
            else if (!strcmp(key, "light")) row->light = value;
            else if (!strcmp(key, "name")) row->name = value;
            else golden_fail("this reader does not support a key");
        }
    }
    if (table->count < 10) golden_fail("the table has fewer than 10 rows");
    for (size_t i = 0; i < table->count; i++)
        if (!table->rows[i].camera || !table->rows[i].fnv1a || !table->rows[i].light || !table->rows[i].name)
            golden_fail("a row without a value");
}

static uint64_t golden_fnv1a(const uint8_t *bytes, size_t count) {
    uint64_t hash = UINT64_C(0xcbf29ce484222325);
    for (size_t i = 0; i < count; i++) hash = (hash ^ bytes[i]) * UINT64_C(0x100000001b3);
    return hash;
}

static uint8_t golden_ramp(size_t p, size_t pixels) { return (uint8_t)(p * 255 / (pixels < 2 ? 2 : pixels)); }

static uint16_t golden_wide(size_t p, size_t pixels) { return (uint16_t)(p * 65535 / (pixels < 2 ? 2 : pixels)); }

static float golden_bright(size_t p, size_t pixels) { return 1.6f * (float)p / (float)pixels; }

#endif
