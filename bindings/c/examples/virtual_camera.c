/* virtual_camera SECONDS [READOUT_HZ]: writes readouts at the rate of a camera to a pipe on standard output. At the end, prints
 * the mean and maximum delay. If the consumer is slow, the program waits. `spikelane live` also supports shared memory and
 * sockets, and can drop readouts. */
#define _POSIX_C_SOURCE 200809L
#include <errno.h>
#include <signal.h>
#include <spikelane.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
#include <unistd.h>

enum { WIDTH = 400, HEIGHT = 250, BURST = 16 };

static volatile sig_atomic_t stopped;

static void stop(int signal) {
    (void)signal;
    stopped = 1;
}

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

static void wait_until(double moment) {
    struct timespec t = {(time_t)moment, (long)(1e9 * (moment - (double)(time_t)moment))};
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, NULL);
}

/* Returns 0 if the reader has closed the pipe. */
static int put(const uint8_t *bytes, size_t count) {
    while (count > 0) {
        const ssize_t written = write(STDOUT_FILENO, bytes, count);
        if (written < 0 && errno == EINTR && !stopped) continue;
        if (written < 0) return 0;
        bytes += written, count -= (size_t)written;
    }
    return 1;
}

int main(int argc, char **argv) {
    if (argc < 2) return fprintf(stderr, "usage: virtual_camera SECONDS [READOUT_HZ] | CONSUMER\n"), 2;
    const double seconds = atof(argv[1]), hz = argc > 2 ? atof(argv[2]) : 20000;
    struct sigaction action = {.sa_handler = stop};
    sigaction(SIGINT, &action, NULL);
    signal(SIGPIPE, SIG_IGN);

    spl_camera *camera;
    spl_simulator *simulator;
    size_t bytes;
    check(spl_camera_preset("physical", &camera));
    check(spl_camera_set_sensor(camera, "readout_hz", hz));
    check(spl_simulator_new(camera, NULL, 1.0, 1, &simulator));
    check(spl_simulator_frame_bytes(simulator, &bytes));
    static uint8_t light[HEIGHT][WIDTH];
    uint8_t *packed = malloc(BURST * bytes);

    double latest = 0, sum = 0;
    long bursts = 0;
    const double start = now();
    for (; !stopped && (double)bursts * BURST < seconds * hz; bursts++) {
        /* The light is a step wedge that moves by one pixel per burst. */
        for (int row = 0; row < HEIGHT; row++)
            for (int col = 0; col < WIDTH; col++) light[row][col] = (uint8_t)((col + bursts) / 25 * 16);
        const spl_frame frame = {light, sizeof light, 0, SPL_U8};
        const spl_light held = {&frame, 1, 0, SPL_INTERPOLATION_HOLD};
        check(spl_simulator_run(simulator, &held, BURST, packed, BURST * bytes));
        const double due = start + (double)(bursts + 1) * BURST / hz;
        wait_until(due);
        if (!put(packed, BURST * bytes)) break;
        const double late = now() - due;
        sum += late, latest = late > latest ? late : latest;
    }
    fprintf(stderr, "%ld readouts in %.2f s at %.0f Hz: mean delay %.2f ms, maximum %.2f ms\n", bursts * BURST,
            now() - start, hz, 1e3 * sum / (double)(bursts ? bursts : 1), 1e3 * latest);
    free(packed);
    check(spl_simulator_free(simulator));
    check(spl_camera_free(camera));
    return 0;
}
