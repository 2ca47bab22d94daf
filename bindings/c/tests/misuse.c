/* Deliberate misuse: every call answers by a status with words, and what is sound goes on as if nothing had been. */
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "spikelane.h"

static int failures;

static void expect(int line, const char *call, spl_status found, spl_status wanted, const char *word) {
    if (found == wanted && (wanted == SPL_OK || strstr(spl_last_error(SPL_MESSAGE), word))) return;
    fprintf(stderr, "misuse.c:%d: %s: found status %d, \"%s\"; expected %d and \"%s\"\n", line, call, (int)found,
            spl_last_error(SPL_MESSAGE), (int)wanted, word);
    failures++;
}

#define OK(call) expect(__LINE__, #call, call, SPL_OK, "")
#define REFUSED(call, status, word) expect(__LINE__, #call, call, status, word)

enum { W = 33, H = 9, BYTES = (W * H + 7) / 8, N = 5 };

static uint8_t grey[W * H], out[N * BYTES], undisturbed[N * BYTES];
static const spl_seeds seeds = {1, 2, 3};

static spl_camera *small(void) {
    spl_camera *camera;
    OK(spl_camera_preset("physical", &camera));
    OK(spl_camera_resize(camera, W, H));
    return camera;
}

static spl_simulator *at_work(const spl_camera *camera) {
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
    REFUSED(spl_camera_parse("width = ", NULL, &camera), SPL_CONFIG, "camera file");
    REFUSED(spl_camera_parse("[maps.gain]\nfile = \"../x.npy\"\ndigest = \"\"", NULL, &camera), SPL_CONFIG, "x.npy");
    REFUSED(spl_camera_load("/nowhere/camera.toml", &camera), SPL_IO, "/nowhere/camera.toml");
    REFUSED(spl_camera_ideal(0, 5, 20000.0, &camera), SPL_USAGE, "sensor size");
    REFUSED(spl_camera_ideal(4294967295u, 4294967295u, 20000.0, &camera), SPL_USAGE, "sensor size");
    REFUSED(spl_camera_ideal(5, 5, -1.0, &camera), SPL_CONFIG, "readout rate");
    camera = small();
    REFUSED(spl_camera_set_effect(camera, "prnu", "sigmma", "0.02"), SPL_CONFIG, "sigmma");
    REFUSED(spl_camera_set_effect(camera, "prnu", "sigma", "2 V"), SPL_CONFIG, "2 V");
    REFUSED(spl_camera_set_effect(camera, "prnu", NULL, "2 V"), SPL_USAGE, "key: found NULL");
    REFUSED(spl_camera_set_effect_number(camera, "prnu", "sigma", -1.0), SPL_CONFIG, "sigma");
    REFUSED(spl_camera_without(camera, "prnoo"), SPL_CONFIG, "prnoo");
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
    spl_simulator *s = at_work(camera);
    size_t bytes;
    REFUSED(spl_camera_resize(NULL, 5, 5), SPL_USAGE, "handle: found NULL");
    REFUSED(spl_camera_resize((spl_camera *)(void *)s, 5, 5), SPL_USAGE, "found a simulator, expected a camera");
    REFUSED(spl_simulator_free((spl_simulator *)(void *)camera), SPL_USAGE, "found a camera");
    uint64_t other[16] = {7};
    REFUSED(spl_simulator_frame_bytes((spl_simulator *)(void *)other, &bytes), SPL_USAGE, "no handle");
    REFUSED(spl_simulator_frame_bytes((spl_simulator *)(void *)((char *)other + 1), &bytes), SPL_USAGE, "no handle");
    REFUSED(spl_simulator_frame_bytes(s, NULL), SPL_USAGE, "bytes: found NULL");
    OK(spl_camera_free(camera));
    /* What was made from it goes on. */
    OK(spl_simulator_frame_bytes(s, &bytes));
    OK(spl_simulator_free(s));
}

static void pushes(void) {
    spl_camera *camera = small();
    spl_simulator *s = at_work(camera), *t;
    const spl_frame good = {grey, sizeof grey, 0, SPL_U8};
    OK(spl_push(s, &good, N, undisturbed, sizeof undisturbed));
    OK(spl_simulator_restart(s, &seeds));
    OK(spl_push(s, &good, 2, out, 2 * BYTES));

    spl_frame f = good;
    REFUSED(spl_push(s, NULL, N, out, sizeof out), SPL_USAGE, "frame: found NULL");
    REFUSED(spl_push(s, &good, N, NULL, sizeof out), SPL_USAGE, "out: found NULL");
    REFUSED(spl_push(s, &good, N, out, sizeof out - 1), SPL_USAGE, "out_bytes");
    REFUSED(spl_push(s, &good, N - 1, out, sizeof out), SPL_USAGE, "out_bytes");
    REFUSED(spl_push(s, &good, SIZE_MAX, out, sizeof out), SPL_USAGE, "out_bytes");
    REFUSED(spl_push(s, &good, N, out, SIZE_MAX), SPL_USAGE, "out");
    f.samples_bytes = sizeof grey - 1;
    REFUSED(spl_push(s, &f, N, out, sizeof out), SPL_INPUT, "samples");
    f = good, f.samples = out + 4;
    REFUSED(spl_push(s, &f, N, out, sizeof out), SPL_USAGE, "overlaps out");
    REFUSED(spl_push_frames(s, &f, 1, N, SPL_HOLD, N, out, sizeof out), SPL_USAGE, "overlaps out");
    REFUSED(spl_unpack(W, H, grey + 5, BYTES, grey, W * H), SPL_USAGE, "overlaps bits");
    REFUSED(spl_unpack(W, H, (uint8_t *)(UINTPTR_MAX - 1), BYTES, grey, W * H), SPL_USAGE, "memory can hold");
    f = good, f.samples = NULL;
    REFUSED(spl_push(s, &f, N, out, sizeof out), SPL_USAGE, "frame: found NULL");
    f = good, f.sample_type = 9;
    REFUSED(spl_push(s, &f, N, out, sizeof out), SPL_USAGE, "sample_type 9");
    f = good, f.stride = W - 1;
    REFUSED(spl_push(s, &f, N, out, sizeof out), SPL_INPUT, "stride");
    f = good, f.stride = SIZE_MAX;
    REFUSED(spl_push(s, &f, N, out, sizeof out), SPL_INPUT, "stride");
    static float floats[W * H];
    f = (spl_frame){(char *)floats + 1, sizeof floats - 4, 0, SPL_F32};
    REFUSED(spl_push(s, &f, N, out, sizeof out), SPL_USAGE, "multiple of 4");
    f.samples = floats, f.samples_bytes = sizeof floats;
    floats[40] = -1.0f;
    REFUSED(spl_push(s, &f, N, out, sizeof out), SPL_INPUT, "row 1, col 7");
    REFUSED(spl_push_frames(s, &good, 1, N, 7, N, out, sizeof out), SPL_USAGE, "insertion");
    REFUSED(spl_push_frames(s, &good, 1, N - 1, SPL_HOLD, N, out, sizeof out), SPL_USAGE, "4");
    REFUSED(spl_push_frames(s, &good, 0, N, SPL_HOLD, N, out, sizeof out), SPL_USAGE, "");
    REFUSED(spl_push_frames(s, &good, 1, 0, SPL_HOLD, 0, out, 0), SPL_USAGE, "");
    REFUSED(spl_push_frames(s, NULL, 1, N, SPL_HOLD, N, out, sizeof out), SPL_USAGE, "frames: found NULL");
    REFUSED(spl_expose_frames(s, &good, 1, N, SPL_HOLD, N, out, sizeof out, NULL), SPL_USAGE, "written");
    REFUSED(spl_simulator_set_backend(s, "avx1024"), SPL_USAGE, "avx1024");
    const spl_seeds another = {9, 2, 3};
    REFUSED(spl_simulator_restart(s, &another), SPL_USAGE, "camera seed");
    REFUSED(spl_simulator_new(camera, &seeds, -1.0, 1, &t), SPL_USAGE, "greatest light");
    REFUSED(spl_simulator_new(camera, &seeds, 1.0, 0, &t), SPL_USAGE, "threads");
    OK(spl_push(s, &good, 0, NULL, 0));

    /* After all of these it goes on as if they had not been. */
    OK(spl_push(s, &good, N - 2, out + 2 * BYTES, (N - 2) * BYTES));
    if (memcmp(out, undisturbed, sizeof out)) failures++, fprintf(stderr, "misuse.c: an error changed the bits\n");
    OK(spl_simulator_free(s));
    OK(spl_camera_free(camera));
}

static void states(void) {
    spl_camera *camera = small(), *other;
    OK(spl_camera_copy(camera, &other));
    OK(spl_camera_set_effect_number(other, "prnu", "sigma", 0.5));
    spl_simulator *s = at_work(camera), *t = at_work(other), *u;
    size_t bytes;
    OK(spl_state_bytes(s, &bytes));
    uint8_t *state = calloc(bytes, 1);
    REFUSED(spl_state_restore(s, state, bytes), SPL_USAGE, "other bytes");
    REFUSED(spl_state_save(s, state, bytes - 1), SPL_USAGE, "spl_state_bytes");
    OK(spl_state_save(s, state, bytes));
    REFUSED(spl_state_restore(t, state, bytes), SPL_USAGE, "another camera");
    REFUSED(spl_state_restore(s, state, bytes - 1), SPL_CORRUPT, "saved state");
    REFUSED(spl_state_restore(s, state, 3), SPL_USAGE, "other bytes");
    REFUSED(spl_state_restore(s, NULL, bytes), SPL_USAGE, "state: found NULL");
    const spl_seeds another = {1, 2, 4};
    OK(spl_simulator_copy(s, &u));
    OK(spl_simulator_restart(u, &another));
    REFUSED(spl_state_restore(u, state, bytes), SPL_USAGE, "other seeds");
    OK(spl_state_restore(s, state, bytes));
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

static void *push_on(void *ignored) {
    (void)ignored;
    const spl_frame frame = {grey, sizeof grey, 0, SPL_U8};
    const size_t readouts = 20000;
    uint8_t *much = malloc(readouts * BYTES);
    while (!done) {
        busy = 1;
        spl_status status = spl_push(shared, &frame, readouts, much, readouts * BYTES);
        if (status != SPL_OK && status != SPL_USAGE) failures++;
    }
    free(much);
    return NULL;
}

/* A call while another thread's is at work: refused, and nothing is torn. */
static void threads(void) {
    spl_camera *camera = small();
    shared = at_work(camera);
    pthread_t thread;
    pthread_create(&thread, NULL, push_on, NULL);
    while (!busy) {}
    const spl_frame frame = {grey, sizeof grey, 0, SPL_U8};
    int refused = 0;
    for (long i = 0; i < 100000000 && !refused; i++) {
        spl_status status = spl_push(shared, &frame, 1, out, BYTES);
        refused = status == SPL_USAGE && strstr(spl_last_error(SPL_FOUND), "another thread");
        if (status != SPL_OK && !refused) failures++;
    }
    if (!refused) failures++, fprintf(stderr, "misuse.c: no call was refused beside another thread's\n");
    done = 1;
    pthread_join(thread, NULL);
    /* Handed over to this thread it works. */
    OK(spl_push(shared, &frame, 1, out, BYTES));
    OK(spl_simulator_free(shared));
    OK(spl_camera_free(camera));
}

int main(int argc, char **argv) {
    if (spl_abi_version() != SPL_ABI_VERSION) return fprintf(stderr, "another library\n"), 1;
    if (spl_last_status() != SPL_OK || *spl_last_error(SPL_MESSAGE) || *spl_last_error(99)) failures++;
    for (size_t i = 0; i < sizeof grey; i++) grey[i] = (uint8_t)i;
    cameras();
    handles();
    pushes();
    states();
    files(argc > 1 ? argv[1] : ".");
    threads();
    printf("misuse.c: %s\n", failures ? "FAILED" : "every call answered");
    return failures != 0;
}
