/* Tests deliberate misuse: every wrong call returns a status and a message, and valid handles remain usable. */
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "spikelane.h"

static int failures;

static void expect(int line, const char *call, spl_status found, spl_status wanted, const char *word) {
    if (found == wanted && (wanted == SPL_OK || strstr(spl_last_error(SPL_ERROR_MESSAGE), word))) return;
    fprintf(stderr, "misuse.c:%d: %s: found status %d, \"%s\"; expected %d and \"%s\"\n", line, call, (int)found,
            spl_last_error(SPL_ERROR_MESSAGE), (int)wanted, word);
    failures++;
}

#define OK(call) expect(__LINE__, #call, call, SPL_OK, "")
#define REFUSED(call, status, word) expect(__LINE__, #call, call, status, word)

enum { W = 33, H = 9, BYTES = (W * H + 7) / 8, N = 5 };

static uint8_t gray[W * H], out[N * BYTES], undisturbed[N * BYTES];
static const spl_seeds seeds = {1, 2, 3};

static spl_camera *small(void) {
    spl_camera *camera;
    OK(spl_camera_preset("physical", &camera));
    OK(spl_camera_resize(camera, W, H));
    return camera;
}

static spl_simulator *running(const spl_camera *camera) {
    spl_simulator *s;
    OK(spl_simulator_new(camera, &seeds, 1.0, 1, &s));
    return s;
}

static void cameras(void) {
    spl_camera *camera = (spl_camera *)1, *part;
    REFUSED(spl_camera_preset(NULL, &camera), SPL_USAGE, "name: found NULL");
    if (camera) failures++, fprintf(stderr, "misuse.c: a failed call left a handle\n");
    REFUSED(spl_camera_preset("physical", NULL), SPL_USAGE, "found NULL");
    REFUSED(spl_camera_preset("phisical", &camera), SPL_CONFIG, "did you mean physical?");
    REFUSED(spl_camera_preset("\xff\xfe", &camera), SPL_USAGE, "UTF-8");
    REFUSED(spl_camera_from_toml("width = ", NULL, &camera), SPL_CONFIG, "camera file");
    REFUSED(spl_camera_from_toml("[maps.gain]\nfile = \"../x.npy\"\ndigest = \"blake3:0000000000000000000000000000000000000000000000000000000000000000\"", NULL, &camera), SPL_CONFIG, "x.npy");
    REFUSED(spl_camera_load("/nowhere/camera.toml", &camera), SPL_IO, "/nowhere/camera.toml");
    REFUSED(spl_camera_ideal(0, 5, 20000.0, &camera), SPL_USAGE, "sensor size");
    REFUSED(spl_camera_ideal(4294967295u, 4294967295u, 20000.0, &camera), SPL_USAGE, "sensor size");
    REFUSED(spl_camera_ideal(5, 5, -1.0, &camera), SPL_CONFIG, "readout rate");
    camera = small();
    REFUSED(spl_camera_set_effect(camera, "prnu", "sigmma", "0.02"), SPL_CONFIG, "sigmma");
    REFUSED(spl_camera_set_effect(camera, "prnu", "sigma", "2 V"), SPL_CONFIG, "2 V");
    REFUSED(spl_camera_set_effect(camera, "prnu", NULL, "2 V"), SPL_USAGE, "key: found NULL");
    REFUSED(spl_camera_set_effect_number(camera, "prnu", "sigma", -1.0), SPL_CONFIG, "sigma");
    REFUSED(spl_camera_remove_effect(camera, "prnoo"), SPL_CONFIG, "prnoo");
    REFUSED(spl_camera_set_sensor(camera, "readout_khz", 20.0), SPL_USAGE, "readout_hz");
    REFUSED(spl_camera_set_sensor(camera, "swing_v", 0.0), SPL_CONFIG, "swing");
    double map[W * H] = {0};
    REFUSED(spl_camera_set_map(camera, "gain", map, W * H - 1), SPL_USAGE, "297");
    REFUSED(spl_camera_set_map(camera, "gain", NULL, W * H), SPL_USAGE, "values: found NULL");
    REFUSED(spl_camera_set_map(camera, "grain", map, W * H), SPL_USAGE, "gain");
    REFUSED(spl_camera_window(camera, 30, 0, 4, 4, &part), SPL_USAGE, "");
    OK(spl_camera_window(camera, 29, 5, 4, 4, &part));
    REFUSED(spl_camera_resize(part, 8, 8), SPL_USAGE, "a window");
    OK(spl_camera_size(part, NULL, NULL, NULL));
    OK(spl_camera_free(part));
    OK(spl_camera_free(camera));
    OK(spl_camera_free(NULL));
}

static void handles(void) {
    spl_camera *camera = small();
    spl_simulator *s = running(camera);
    size_t bytes;
    REFUSED(spl_camera_resize(NULL, 5, 5), SPL_USAGE, "handle: found NULL");
    REFUSED(spl_camera_resize((spl_camera *)(void *)s, 5, 5), SPL_USAGE, "found a simulator, expected a camera");
    REFUSED(spl_simulator_free((spl_simulator *)(void *)camera), SPL_USAGE, "found a camera");
    uint64_t other[16] = {7};
    REFUSED(spl_simulator_frame_bytes((spl_simulator *)(void *)other, &bytes), SPL_USAGE, "no handle");
    REFUSED(spl_simulator_frame_bytes((spl_simulator *)(void *)((char *)other + 1), &bytes), SPL_USAGE, "no handle");
    REFUSED(spl_simulator_frame_bytes(s, NULL), SPL_USAGE, "bytes: found NULL");
    OK(spl_camera_free(camera));
    /* A simulator remains usable after its camera is freed. */
    OK(spl_simulator_frame_bytes(s, &bytes));
    OK(spl_simulator_free(s));
}

static void runs(void) {
    spl_camera *camera = small();
    spl_simulator *s = running(camera), *t;
    const spl_frame good = {gray, sizeof gray, 0, SPL_U8};
    const spl_light held = {&good, 1, 0, SPL_INTERPOLATION_HOLD};
    OK(spl_simulator_run(s, &held, N, undisturbed, sizeof undisturbed));
    OK(spl_simulator_restart(s, &seeds));
    OK(spl_simulator_run(s, &held, 2, out, 2 * BYTES));

    REFUSED(spl_simulator_run(s, NULL, N, out, sizeof out), SPL_USAGE, "light: found NULL");
    REFUSED(spl_simulator_run(s, &held, N, NULL, sizeof out), SPL_USAGE, "packed: found NULL");
    REFUSED(spl_simulator_run(s, &held, N, out, sizeof out - 1), SPL_USAGE, "packed_bytes");
    REFUSED(spl_simulator_run(s, &held, N - 1, out, sizeof out), SPL_USAGE, "packed_bytes");
    REFUSED(spl_simulator_run(s, &held, SIZE_MAX, out, sizeof out), SPL_USAGE, "packed_bytes");
    REFUSED(spl_simulator_run(s, &held, N, out, SIZE_MAX), SPL_USAGE, "packed");
    spl_frame f = good;
    const spl_light changed = {&f, 1, 0, SPL_INTERPOLATION_HOLD}, one_each = {&f, 1, N, SPL_INTERPOLATION_HOLD};
    f.samples_bytes = sizeof gray - 1;
    REFUSED(spl_simulator_run(s, &changed, N, out, sizeof out), SPL_INPUT, "samples");
    f = good, f.samples = out + 4;
    REFUSED(spl_simulator_run(s, &changed, N, out, sizeof out), SPL_USAGE, "overlaps packed");
    REFUSED(spl_simulator_run(s, &one_each, N, out, sizeof out), SPL_USAGE, "overlaps packed");
    union {
        spl_light light;
        uint8_t bytes[BYTES];
    } both = {.light = held};
    REFUSED(spl_simulator_run(s, &both.light, 1, both.bytes, BYTES), SPL_USAGE, "overlaps packed");
    REFUSED(spl_unpack(W, H, gray + 5, BYTES, gray, W * H), SPL_USAGE, "overlaps bits");
    REFUSED(spl_unpack(W, H, (uint8_t *)(UINTPTR_MAX - 1), BYTES, gray, W * H), SPL_USAGE, "memory can hold");
    f = good, f.samples = NULL;
    REFUSED(spl_simulator_run(s, &changed, N, out, sizeof out), SPL_USAGE, "frame 0: found NULL");
    f = good, f.sample_type = 9;
    REFUSED(spl_simulator_run(s, &changed, N, out, sizeof out), SPL_USAGE, "sample_type 9");
    f = good, f.stride = W - 1;
    REFUSED(spl_simulator_run(s, &changed, N, out, sizeof out), SPL_INPUT, "stride");
    f = good, f.stride = SIZE_MAX;
    REFUSED(spl_simulator_run(s, &changed, N, out, sizeof out), SPL_INPUT, "stride");
    static float floats[W * H];
    f = (spl_frame){(char *)floats + 1, sizeof floats - 4, 0, SPL_F32};
    REFUSED(spl_simulator_run(s, &changed, N, out, sizeof out), SPL_USAGE, "multiple of 4");
    spl_simulator *first = running(camera);
    for (size_t i = 0; i < W * H; i++) floats[i] = 200;
    f = (spl_frame){floats, sizeof floats, 0, SPL_F32};
    REFUSED(spl_simulator_run(first, &changed, N, out, sizeof out), SPL_INPUT, "found the value 200");
    for (size_t i = 0; i < W * H; i++) floats[i] = 0;
    OK(spl_simulator_free(first));
    f.samples = floats, f.samples_bytes = sizeof floats;
    floats[40] = -1.0f;
    REFUSED(spl_simulator_run(s, &changed, N, out, sizeof out), SPL_INPUT, "row 1, col 7");
    spl_light l = {&good, 1, N, 7};
    REFUSED(spl_simulator_run(s, &l, N, out, sizeof out), SPL_USAGE, "interpolation");
    l = (spl_light){&good, 1, N - 1, SPL_INTERPOLATION_HOLD};
    REFUSED(spl_simulator_run(s, &l, N, out, sizeof out), SPL_USAGE, "at most 4");
    l = (spl_light){&good, 0, N, SPL_INTERPOLATION_HOLD};
    REFUSED(spl_simulator_run(s, &l, N, out, sizeof out), SPL_USAGE, "count: found 0");
    const spl_frame two[] = {good, good};
    l = (spl_light){two, 2, 0, SPL_INTERPOLATION_HOLD};
    REFUSED(spl_simulator_run(s, &l, N, out, sizeof out), SPL_USAGE, "readouts_per_frame: found 0");
    l = (spl_light){NULL, 1, N, SPL_INTERPOLATION_HOLD};
    REFUSED(spl_simulator_run(s, &l, N, out, sizeof out), SPL_USAGE, "frames: found NULL");
    l = (spl_light){&good, SIZE_MAX, N, SPL_INTERPOLATION_HOLD};
    REFUSED(spl_simulator_run(s, &l, N, out, sizeof out), SPL_USAGE, "frames");
    size_t written;
    REFUSED(spl_simulator_advance(s, &held, N, out, sizeof out, NULL), SPL_USAGE, "written");
    REFUSED(spl_simulator_advance(s, &held, N - 1, out, sizeof out, &written), SPL_USAGE, "packed_bytes");
    REFUSED(spl_simulator_advance(s, NULL, N, out, sizeof out, &written), SPL_USAGE, "light: found NULL");
    REFUSED(spl_simulator_set_backend(s, "avx1024"), SPL_USAGE, "avx1024");
    const spl_seeds another = {9, 2, 3};
    REFUSED(spl_simulator_restart(s, &another), SPL_USAGE, "camera seed");
    REFUSED(spl_simulator_new(camera, &seeds, -1.0, 1, &t), SPL_USAGE, "max light");
    REFUSED(spl_simulator_new(camera, &seeds, 1.0, 0, &t), SPL_USAGE, "threads");
    OK(spl_simulator_run(s, &held, 0, NULL, 0));
    const uint16_t narrow[] = {0, 100, 4000}, wide[] = {0, 100, 40000};
    uint32_t white = 1;
    OK(spl_light_narrow_codes(narrow, 3, &white));
    if (white != 4095) failures++, fprintf(stderr, "misuse.c: codes of 12 bits have white %u\n", white);
    OK(spl_light_narrow_codes(wide, 3, &white));
    if (white != 0) failures++, fprintf(stderr, "misuse.c: codes of 16 bits have white %u\n", white);
    REFUSED(spl_light_narrow_codes(NULL, 3, &white), SPL_USAGE, "samples: found NULL");

    /* The failed calls must not have changed the state of the simulator. */
    OK(spl_simulator_run(s, &held, N - 2, out + 2 * BYTES, (N - 2) * BYTES));
    if (memcmp(out, undisturbed, sizeof out)) failures++, fprintf(stderr, "misuse.c: an error changed the bits\n");
    OK(spl_simulator_free(s));
    OK(spl_camera_free(camera));
}

static void states(void) {
    spl_camera *camera = small(), *other;
    OK(spl_camera_copy(camera, &other));
    OK(spl_camera_set_effect_number(other, "prnu", "sigma", 0.5));
    spl_simulator *s = running(camera), *t = running(other), *u;
    size_t bytes;
    OK(spl_simulator_state_bytes(s, &bytes));
    uint8_t *state = calloc(bytes, 1);
    REFUSED(spl_simulator_state_restore(s, state, bytes), SPL_USAGE, "other data");
    REFUSED(spl_simulator_state_save(s, state, bytes - 1), SPL_USAGE, "spl_simulator_state_bytes");
    OK(spl_simulator_state_save(s, state, bytes));
    REFUSED(spl_simulator_state_restore(t, state, bytes), SPL_USAGE, "another camera");
    REFUSED(spl_simulator_state_restore(s, state, bytes - 1), SPL_CORRUPT, "saved state");
    REFUSED(spl_simulator_state_restore(s, state, 3), SPL_USAGE, "other data");
    REFUSED(spl_simulator_state_restore(s, NULL, bytes), SPL_USAGE, "state: found NULL");
    const spl_seeds another = {1, 2, 4};
    OK(spl_simulator_copy(s, &u));
    OK(spl_simulator_restart(u, &another));
    REFUSED(spl_simulator_state_restore(u, state, bytes), SPL_USAGE, "other seeds");
    OK(spl_simulator_state_restore(s, state, bytes));
    free(state);
    OK(spl_simulator_free(s));
    OK(spl_simulator_free(t));
    OK(spl_simulator_free(u));
    OK(spl_camera_free(camera));
    OK(spl_camera_free(other));
}

static void files(const char *folder) {
    char path[4096];
    snprintf(path, sizeof path, "%s/misuse.dat", folder);
    remove(path);
    spl_writer *w;
    REFUSED(spl_writer_create(path, W, H, "tiff", 0, &w), SPL_USAGE, "tiff");
    REFUSED(spl_writer_create("/nowhere/a.dat", W, H, NULL, 0, &w), SPL_IO, "/nowhere");
    OK(spl_writer_create(path, W, H, NULL, 0, &w));
    REFUSED(spl_writer_write(w, out, BYTES + 1), SPL_USAGE, "bytes");
    OK(spl_writer_free(w));
    if (fopen(path, "rb")) failures++, fprintf(stderr, "misuse.c: an unfinished stream left a file\n");
    OK(spl_writer_create(path, W, H, NULL, 0, &w));
    OK(spl_writer_write(w, out, sizeof out));
    OK(spl_writer_finish(w));
    REFUSED(spl_writer_finish(w), SPL_USAGE, "finished");
    REFUSED(spl_writer_write(w, out, sizeof out), SPL_USAGE, "finished");
    OK(spl_writer_free(w));
    REFUSED(spl_writer_create(path, W, H, NULL, 0, &w), SPL_EXISTS, "misuse.dat");
    remove(path);
    static uint8_t bits[N * W * H];
    REFUSED(spl_unpack(W, H, out, sizeof out, bits, sizeof bits - 1), SPL_USAGE, "");
    OK(spl_unpack(W, H, out, sizeof out, bits, sizeof bits));
}

static atomic_int busy, done;
static spl_simulator *shared;

static void *run_on(void *ignored) {
    (void)ignored;
    const spl_frame frame = {gray, sizeof gray, 0, SPL_U8};
    const spl_light light = {&frame, 1, 0, SPL_INTERPOLATION_HOLD};
    const size_t readouts = 20000;
    uint8_t *much = malloc(readouts * BYTES);
    while (!done) {
        busy = 1;
        spl_status status = spl_simulator_run(shared, &light, readouts, much, readouts * BYTES);
        if (status != SPL_OK && status != SPL_USAGE) failures++;
    }
    free(much);
    return NULL;
}

/* Tests that a call during a call of another thread fails and does not change the state. */
static void threads(void) {
    spl_camera *camera = small();
    shared = running(camera);
    pthread_t thread;
    pthread_create(&thread, NULL, run_on, NULL);
    while (!busy) {}
    const spl_frame frame = {gray, sizeof gray, 0, SPL_U8};
    const spl_light light = {&frame, 1, 0, SPL_INTERPOLATION_HOLD};
    int refused = 0;
    for (long i = 0; i < 100000000 && !refused; i++) {
        spl_status status = spl_simulator_run(shared, &light, 1, out, BYTES);
        refused = status == SPL_USAGE && strstr(spl_last_error(SPL_ERROR_FOUND), "another thread");
        if (status != SPL_OK && !refused) failures++;
    }
    if (!refused) failures++, fprintf(stderr, "misuse.c: no call was refused beside another thread's\n");
    done = 1;
    pthread_join(thread, NULL);
    /* After the other thread has ended, this thread can use the simulator. */
    OK(spl_simulator_run(shared, &light, 1, out, BYTES));
    OK(spl_simulator_free(shared));
    OK(spl_camera_free(camera));
}

int main(int argc, char **argv) {
    if (spl_abi_version() != SPL_ABI_VERSION) return fprintf(stderr, "another library\n"), 1;
    if (spl_last_status() != SPL_OK || *spl_last_error(SPL_ERROR_MESSAGE) || *spl_last_error(99)) failures++;
    for (size_t i = 0; i < sizeof gray; i++) gray[i] = (uint8_t)i;
    cameras();
    handles();
    runs();
    states();
    files(argc > 1 ? argv[1] : ".");
    threads();
    printf("misuse.c: %s\n", failures ? "FAILED" : "every call answered");
    return failures != 0;
}
