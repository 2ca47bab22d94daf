/* render_loop [FRAMES [READOUTS_PER_FRAME]]: renders frames and passes each frame to the camera, by default 10,000 frames of 20
 * readouts. Prints the numbers of frames and readouts per second. */
#include <math.h>
#include <spikelane.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

enum { WIDTH = 400, HEIGHT = 250 };

static void check(spl_status status) {
    if (status == SPL_OK) return;
    fprintf(stderr, "%s\n", spl_last_error(SPL_ERROR_MESSAGE));
    exit(status);
}

static double now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* Renders waves that move to the right, in linear light. Replace this function with your renderer. */
static void render(long frame, float light[HEIGHT][WIDTH]) {
    float wave[WIDTH];
    for (int col = 0; col < WIDTH; col++) wave[col] = 0.25f + 0.2f * sinf(0.05f * (float)(col - frame));
    for (int row = 0; row < HEIGHT; row++)
        for (int col = 0; col < WIDTH; col++) light[row][col] = wave[col] * (float)(row + 1) / HEIGHT;
}

int main(int argc, char **argv) {
    const long frames = argc > 1 ? atol(argv[1]) : 10000;
    const size_t readouts = argc > 2 ? (size_t)atol(argv[2]) : 20;
    if (frames < 1 || readouts < 1) return fprintf(stderr, "usage: render_loop [FRAMES [READOUTS_PER_FRAME]]\n"), 2;

    spl_camera *camera;
    spl_simulator *simulator;
    size_t bytes;
    check(spl_camera_preset("physical", &camera));
    check(spl_simulator_new(camera, NULL, 1.0, 1, &simulator));
    check(spl_simulator_frame_bytes(simulator, &bytes));
    uint8_t *packed = malloc(readouts * bytes);
    static float light[2][HEIGHT][WIDTH];

    double drawing = 0, spikes = 0;
    const double start = now();
    render(0, light[0]);
    for (long k = 0; k < frames; k++) {
        const double before = now();
        render(k + 1, light[(k + 1) % 2]);
        drawing += now() - before;
        /* The light changes linearly from this frame to the next, so moving edges do not jump. */
        const spl_frame both[] = {{light[k % 2], sizeof light[0], 0, SPL_F32},
                                  {light[(k + 1) % 2], sizeof light[0], 0, SPL_F32}};
        const spl_light linear = {both, 2, (uint32_t)readouts, SPL_INTERPOLATION_LINEAR};
        check(spl_simulator_run(simulator, &linear, readouts, packed, readouts * bytes));
        for (size_t i = 0; i < readouts * bytes; i++) spikes += packed[i] & 1; /* Replace this line with your consumer. */
    }
    const double seconds = now() - start;
    printf("%ld frames of %zu readouts in %.2f s: %.0f frames/s, %.0f readouts/s, rendering took %.2f s\n", frames,
           readouts, seconds, (double)frames / seconds, (double)frames * (double)readouts / seconds, drawing);
    printf("%.3f spikes per pixel and readout in every eighth column\n",
           spikes / ((double)frames * (double)readouts * (double)bytes));
    free(packed);
    check(spl_simulator_free(simulator));
    check(spl_camera_free(camera));
    return 0;
}
