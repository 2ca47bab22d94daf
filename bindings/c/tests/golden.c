/* golden TABLE [BACKEND]: tests every row of the golden table on each backend of this CPU except avx512. Simulates each row in
 * one call and, for most rows, again with a saved state in a second simulator. */
#include "golden.h"
#include "spikelane.h"

#define OK(call)                                                                                       \
    do {                                                                                               \
        if ((call) != SPL_OK) {                                                                        \
            fprintf(stderr, "%s:%d: %s\n", __FILE__, __LINE__, spl_last_error(SPL_ERROR_MESSAGE));           \
            exit(1);                                                                                   \
        }                                                                                              \
    } while (0)

typedef struct {
    size_t pixels, bytes;
    void *first, *second;
    spl_frame frames[2];
} light;

static void make_light(const golden_row *row, light *l) {
    size_t n = l->pixels;
    uint8_t *a = calloc(n, 4), *b = calloc(n, 4);
    for (size_t p = 0; p < n; p++) {
        if (!strcmp(row->light, "u16")) ((uint16_t *)(void *)a)[p] = golden_wide(p, n);
        else if (!strcmp(row->light, "bright")) ((float *)(void *)a)[p] = golden_bright(p, n);
        else a[p] = golden_ramp(p, n), b[n - 1 - p] = a[p];
    }
    int wide = !strcmp(row->light, "u16"), bright = !strcmp(row->light, "bright");
    size_t size = bright ? 4 : wide ? 2 : 1;
    uint32_t type = bright ? SPL_F32 : wide ? SPL_U16 : SPL_U8;
    l->first = a, l->second = b;
    l->frames[0] = (spl_frame){a, n * size, 0, type};
    l->frames[1] = (spl_frame){b, n * size, 0, type};
}

static void pass(spl_simulator *s, spl_light light, size_t readouts, uint8_t *out, size_t frame_bytes) {
    OK(spl_simulator_run(s, &light, readouts, out, readouts * frame_bytes));
}

/* Simulates readouts `from` to `to` - 1 of the row. The light of "bright" is dark from readout 150 on. */
static void run(spl_simulator *s, const golden_row *row, light *l, size_t from, size_t to, uint8_t *out) {
    size_t cut = strcmp(row->light, "bright") ? GOLDEN_READOUTS : 150;
    if (!strcmp(row->light, "between")) {
        if (from == 0 && to == GOLDEN_READOUTS)
            pass(s, (spl_light){l->frames, 2, (uint32_t)to, SPL_INTERPOLATION_LINEAR}, to, out, l->bytes);
        else exit(2);
        return;
    }
    size_t middle = to < cut ? to : cut;
    const spl_light held[] = {{&l->frames[0], 1, 0, SPL_INTERPOLATION_HOLD},
                              {&l->frames[1], 1, 0, SPL_INTERPOLATION_HOLD}};
    if (from < middle) pass(s, held[0], middle - from, out, l->bytes);
    size_t start = from > cut ? from : cut;
    if (start < to) pass(s, held[1], to - start, out + (start - from) * l->bytes, l->bytes);
}

static spl_simulator *simulator(const spl_camera *camera, const char *backend) {
    const spl_seeds seeds = {11, 22, 33};
    spl_simulator *s;
    OK(spl_simulator_new(camera, &seeds, 1.6, 1, &s));
    if (spl_simulator_set_backend(s, backend) != SPL_OK) {
        OK(spl_simulator_free(s));
        return NULL;
    }
    return s;
}

static void expect(const golden_row *row, const char *backend, const char *how, const uint8_t *out, size_t bytes) {
    char found[19];
    snprintf(found, sizeof found, "0x%016llx", (unsigned long long)golden_fnv1a(out, bytes));
    if (strcmp(found, row->fnv1a)) {
        fprintf(stderr, "%s on %s, %s: found %s, expected %s\n", row->name, backend, how, found, row->fnv1a);
        exit(1);
    }
}

/* Simulates `at` readouts, saves the state, and simulates the remaining readouts in another simulator on the portable backend. */
static void resumed(const spl_camera *camera, const golden_row *row, light *l, const char *backend, uint8_t *out) {
    const size_t at = 77;
    spl_simulator *one = simulator(camera, backend), *two = simulator(camera, "portable");
    run(one, row, l, 0, at, out);
    size_t bytes;
    OK(spl_simulator_state_bytes(one, &bytes));
    uint8_t *state = malloc(bytes);
    OK(spl_simulator_state_save(one, state, bytes));
    OK(spl_simulator_state_restore(two, state, bytes));
    uint64_t readout;
    OK(spl_simulator_readout(two, &readout));
    /* The readout number also counts dropped readouts, so it can exceed the number of written readouts. */
    if (readout < at) exit(3);
    run(two, row, l, at, GOLDEN_READOUTS, out + at * l->bytes);
    free(state);
    OK(spl_simulator_free(one));
    OK(spl_simulator_free(two));
}

/* Returns 1 if this CPU has the backend, and 0 otherwise. */
static int check(const golden_row *row, const char *backend) {
    spl_camera *camera;
    OK(spl_camera_from_toml(row->camera, NULL, &camera));
    spl_simulator *s = simulator(camera, backend);
    if (!s) {
        OK(spl_camera_free(camera));
        return 0;
    }
    light l = {0};
    uint32_t width, height;
    OK(spl_camera_size(camera, &width, &height, NULL));
    OK(spl_simulator_frame_bytes(s, &l.bytes));
    l.pixels = (size_t)width * height;
    make_light(row, &l);
    const size_t bytes = GOLDEN_READOUTS * l.bytes;
    uint8_t *out = malloc(bytes);
    run(s, row, &l, 0, GOLDEN_READOUTS, out);
    expect(row, backend, "in one piece", out, bytes);
    /* After a restart with other seeds, a restart with the first seeds must repeat the first bits. */
    const spl_seeds other = {11, 22, 34}, same = {11, 22, 33};
    OK(spl_simulator_restart(s, &other));
    OK(spl_simulator_restart(s, &same));
    run(s, row, &l, 0, GOLDEN_READOUTS, out);
    expect(row, backend, "after a restart", out, bytes);
    if (strcmp(row->light, "between")) {
        resumed(camera, row, &l, backend, out);
        expect(row, backend, "resumed", out, bytes);
    }
    free(out), free(l.first), free(l.second);
    OK(spl_simulator_free(s));
    OK(spl_camera_free(camera));
    return 1;
}

int main(int argc, char **argv) {
    if (argc < 2) return fprintf(stderr, "usage: golden TABLE [BACKEND]\n"), 2;
    static golden_table table;
    golden_read(argv[1], &table);
    const char *backends[] = {"reference", "portable", "sse4.1", "avx2", "avx512"};
    for (size_t b = 0; b < sizeof backends / sizeof *backends; b++) {
        if (argc > 2 && strcmp(argv[2], backends[b])) continue;
        size_t ran = 0;
        for (size_t i = 0; i < table.count; i++) ran += (size_t)check(&table.rows[i], backends[b]);
        if (ran) printf("golden.c: %zu rows on %s\n", ran, backends[b]);
        else printf("golden.c: skipped %s: %s\n", backends[b], spl_last_error(SPL_ERROR_MESSAGE));
    }
    free(table.text);
    return 0;
}
