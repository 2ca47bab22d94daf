/* ring_reader PATH: reads the ring of `spikelane live --sink shm:NAME` until the stream ends; PATH is /dev/shm/NAME. Prints the
 * numbers of readouts, lost readouts and spikes. Needs no library; docs/reference/live.md describes the layout of the ring. */
#include <fcntl.h>
#include <stdatomic.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

enum { MAGIC, SIZE, FRAME_BYTES, SLOTS, SLOT_WORDS, RATE, LAYOUT, WRITTEN = 8, STATE, READ = 16, HEADER = 32 };

static void nap(void) {
    const struct timespec pause = {0, 200000};
    nanosleep(&pause, NULL);
}

int main(int argc, char **argv) {
    if (argc < 2) return fprintf(stderr, "usage: ring_reader PATH\n"), 2;
    int file = -1;
    struct stat about = {0};
    for (int tries = 0; tries < 50000 && (file < 0 || about.st_size < HEADER * 8); tries++) {
        if (file < 0) file = open(argv[1], O_RDWR);
        if (file >= 0) fstat(file, &about);
        nap();
    }
    if (file < 0) return perror(argv[1]), 5;
    const size_t bytes = (size_t)about.st_size;
    _Atomic uint64_t *ring = mmap(NULL, bytes, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    if (ring == MAP_FAILED) return perror(argv[1]), 5;
    uint64_t magic;
    memcpy(&magic, "SPKRING1", 8);
    while (atomic_load_explicit(&ring[MAGIC], memory_order_acquire) != magic) nap();

    const size_t frame_bytes = ring[FRAME_BYTES];
    const uint64_t slots = ring[SLOTS], slot_words = ring[SLOT_WORDS];
    double hz;
    const uint64_t rate = ring[RATE];
    memcpy(&hz, &rate, 8);
    printf("%ux%u pixels at %.0f Hz, layout %.16s, %llu slots of %zu bytes\n", (unsigned)ring[SIZE],
           (unsigned)(ring[SIZE] >> 32), hz, (const char *)(const void *)&ring[LAYOUT], (unsigned long long)slots,
           frame_bytes);

    uint8_t *frame = malloc(frame_bytes);
    uint64_t next = 0, seen = 0, spikes = 0;
    for (;;) {
        const uint64_t ended = atomic_load_explicit(&ring[STATE], memory_order_acquire) == 2;
        const uint64_t written = atomic_load_explicit(&ring[WRITTEN], memory_order_acquire);
        if (next >= written) {
            if (ended) break;
            nap();
            continue;
        }
        if (written - next > slots) next = written - slots;
        _Atomic uint64_t *slot = ring + HEADER + next % slots * slot_words;
        const uint64_t before = atomic_load_explicit(slot, memory_order_acquire);
        memcpy(frame, (const void *)(slot + 1), frame_bytes);
        atomic_thread_fence(memory_order_acquire);
        const uint64_t after = atomic_load_explicit(slot, memory_order_relaxed);
        next++;
        if (before != next || after != next) continue; /* The writer has overwritten the slot, so this readout is lost. */
        atomic_store_explicit(&ring[READ], next, memory_order_release);
        seen++;
        for (size_t i = 0; i < frame_bytes; i++) spikes += (uint64_t)__builtin_popcount(frame[i]);
    }
    printf("%llu readouts, %llu lost, %llu spikes\n", (unsigned long long)seen, (unsigned long long)(next - seen),
           (unsigned long long)spikes);
    free(frame);
    return 0;
}
