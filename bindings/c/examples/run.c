/* Hold a gray frame for 1,000 readouts and count the spikes. */
#include <spikelane.h>
#include <stdio.h>
#include <stdlib.h>

static void check(spl_status status) {
    if (status == SPL_OK) return;
    fprintf(stderr, "%s\n", spl_last_error(SPL_ERROR_MESSAGE));
    exit(status);
}

int main(void) {
    enum { WIDTH = 400, HEIGHT = 250, READOUTS = 1000 };
    static uint8_t light[HEIGHT][WIDTH], bits[HEIGHT][WIDTH];
    for (int row = 0; row < HEIGHT; row++)
        for (int col = 0; col < WIDTH; col++) light[row][col] = 51; /* a fifth of full scale */

    spl_camera *camera;
    spl_simulator *simulator;
    const spl_seeds seeds = {1, 2, 3};
    check(spl_camera_preset("physical", &camera)); /* 400x250 at 20 kHz, with all its noise */
    check(spl_simulator_new(camera, &seeds, 1.0, 1, &simulator));

    size_t bytes;
    check(spl_simulator_frame_bytes(simulator, &bytes));
    uint8_t *packed = malloc(READOUTS * bytes);
    const spl_frame frame = {light, sizeof light, 0, SPL_U8};
    const spl_light held = {&frame, 1, 0, SPL_INTERPOLATION_HOLD}; /* the same frame for all readouts */
    check(spl_simulator_run(simulator, &held, READOUTS, packed, READOUTS * bytes));

    long spikes = 0;
    for (int t = 0; t < READOUTS; t++) {
        check(spl_unpack(WIDTH, HEIGHT, packed + t * bytes, bytes, &bits[0][0], sizeof bits));
        for (int p = 0; p < WIDTH * HEIGHT; p++) spikes += bits[p / WIDTH][p % WIDTH];
    }
    printf("%.4f spikes per pixel and readout\n", (double)spikes / READOUTS / (WIDTH * HEIGHT));
    free(packed);
    check(spl_simulator_free(simulator));
    check(spl_camera_free(camera));
    return 0;
}
