/*
 * spikelane: simulates spike cameras. Light in, bit-packed readouts out.
 *
 * Made by cbindgen from bindings/c/src; do not edit.
 *
 * A spike camera's pixel gathers charge and raises a flag when it passes a threshold; all flags are read out 20,000
 * to 40,000 times a second, one bit a pixel.
 *
 *     spl_camera *camera;                                       // what the noise is
 *     spl_simulator *simulator;                                 // a camera at work
 *     size_t bytes;                                             // of one packed readout
 *     if (spl_camera_preset("physical", &camera) != SPL_OK ||   // 400x250 pixels at 20 kHz
 *         spl_simulator_new(camera, NULL, 1.0, 1, &simulator) != SPL_OK ||
 *         spl_simulator_frame_bytes(simulator, &bytes) != SPL_OK)
 *         fprintf(stderr, "%s\n", spl_last_error(SPL_MESSAGE));
 *     spl_frame frame = {grey, sizeof grey, 0, SPL_U8};         // uint8_t grey[250 * 400]
 *     spl_push(simulator, &frame, 64, packed, 64 * bytes);      // 64 readouts of it
 *     spl_simulator_free(simulator);
 *     spl_camera_free(camera);
 *
 * Light is linear: the number of photons, not the code of a picture file. Rows run from top to bottom.
 *
 * Packed readouts: bit p % 8 of byte p / 8, least significant first, is pixel p = row * width + col. A readout has
 * (width * height + 7) / 8 bytes; bits behind the last pixel are 0.
 *
 * Sizes and places are given as width before height and col before row.
 *
 * Errors. Every function that can fail returns an spl_status; SPL_OK is 0. After another value spl_last_error()
 * says for this thread what was wrong, what was found, what was expected and what to do. A function that failed has
 * changed nothing, unless it says otherwise; a handle that it would have made is set to NULL.
 *
 * Handles. Free every handle once, with the function of its name that ends in _free, and do not use it afterwards, as
 * with free() of C. Functions return SPL_USAGE for NULL and for a handle of another kind. Several threads may read a
 * camera at a time. A simulator or writer may go from thread to thread; a call while another thread's call works on
 * it returns SPL_USAGE and changes nothing.
 *
 * Strings are UTF-8 and end in NUL. Buffers come with their size in bytes, and a wrong size is an error.
 *
 * The library calls nothing back, prints nothing (but the words of a panic of its own), reads the environment variable
 * SPIKELANE_BACKEND and no other, and starts threads only when asked to. The same camera, seeds and light give the same
 * bits on every machine, backend and number of threads, in C, C++, Rust, Python and from the program `spikelane`.
 */


#ifndef SPIKELANE_H
#define SPIKELANE_H

#include <stddef.h>
#include <stdint.h>

/**
 * Changes when a program that was compiled with an older header could go wrong.
 */
#define SPL_ABI_VERSION 1

/**
 * Part of an error: all of it in one line.
 */
#define SPL_MESSAGE 0

/**
 * Part of an error: the thing that it is about, such as an argument, a key or a file.
 */
#define SPL_SUBJECT 1

/**
 * Part of an error: what was found there.
 */
#define SPL_FOUND 2

/**
 * Part of an error: what was expected instead.
 */
#define SPL_EXPECTED 3

/**
 * Part of an error: what to do about it.
 */
#define SPL_REMEDY 4

/**
 * Samples of uint8_t; full scale is 255.
 */
#define SPL_U8 0

/**
 * Samples of uint16_t in the machine's byte order; full scale is 65535.
 */
#define SPL_U16 1

/**
 * Samples of float, finite and not negative; full scale is 1.0.
 */
#define SPL_F32 2

/**
 * Between two frames the light stays what the first was.
 */
#define SPL_HOLD 0

/**
 * Between two frames the light goes in a straight line.
 */
#define SPL_LINEAR 1

/**
 * Between two frames the light moves along an estimated motion.
 */
#define SPL_FLOW 2

/**
 * What came of a call. The numbers are the exit codes of the program `spikelane`.
 */
enum spl_status
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  /**
   * Done.
   */
  SPL_OK = 0,
  /**
   * An argument, or a combination of arguments, makes no sense.
   */
  SPL_USAGE = 2,
  /**
   * A preset or camera file describes something impossible.
   */
  SPL_CONFIG = 3,
  /**
   * The bytes of an input are not what they claim to be.
   */
  SPL_INPUT = 4,
  /**
   * The system refused to read or write.
   */
  SPL_IO = 5,
  /**
   * The disk cannot hold the result.
   */
  SPL_SPACE = 6,
  /**
   * The output exists and nobody allowed overwriting it.
   */
  SPL_EXISTS = 7,
  /**
   * A program that is needed is missing or failed.
   */
  SPL_TOOL = 8,
  /**
   * Bytes do not match their digest.
   */
  SPL_CORRUPT = 9,
  /**
   * Another process writes this output.
   */
  SPL_BUSY = 10,
  /**
   * The system has no memory for a size that an input or an argument requires.
   */
  SPL_MEMORY = 11,
  /**
   * A fault of the library. The handles of the call answer nothing more but their _free; please report it.
   */
  SPL_PANIC = 101,
  /**
   * The user asked to stop.
   */
  SPL_INTERRUPTED = 130,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum spl_status spl_status;
#else
typedef int32_t spl_status;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * A camera: sensor, imperfections, measured maps.
 */
typedef struct spl_camera spl_camera;

/**
 * A camera at work: it remembers its charge from call to call.
 */
typedef struct spl_simulator spl_simulator;

/**
 * A stream of readouts on its way into a file.
 */
typedef struct spl_writer spl_writer;

/**
 * What fixes the noise.
 */
typedef struct {
  /**
   * Which camera of its kind: the fixed pattern.
   */
  uint64_t camera;
  /**
   * Temporal noise and start charge.
   */
  uint64_t shot;
  /**
   * Which recording; sequences of one seed share no noise.
   */
  uint64_t sequence;
} spl_seeds;

/**
 * A frame of linear light that is read during a call, and not kept.
 */
typedef struct {
  /**
   * The first sample of the top row, aligned as its type asks.
   */
  const void *samples;
  /**
   * Bytes from there on that may be read.
   */
  uintptr_t samples_bytes;
  /**
   * Samples from the start of a row to the start of the next; 0 for rows without a gap.
   */
  uintptr_t stride;
  /**
   * SPL_U8, SPL_U16 or SPL_F32.
   */
  uint32_t sample_type;
} spl_frame;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

/**
 * The ABI of the library: SPL_ABI_VERSION of the header that it was made with. Another number than the one of the header that a
 * program was compiled with means another library.
 */
uint32_t spl_abi_version(void);

/**
 * The version of the library, such as "0.1.0".
 */
const char *spl_version(void);

/**
 * The status of the last call of this thread that failed; SPL_OK when none has. A call that succeeds leaves it.
 */
spl_status spl_last_status(void);

/**
 * What the last call of this thread that failed had to say: SPL_MESSAGE is all of it, SPL_SUBJECT, SPL_FOUND, SPL_EXPECTED
 * and SPL_REMEDY are its parts. Empty for what it did not say; never NULL. Valid until the next call of this
 * thread that fails, or its end.
 */
const char *spl_last_error(uint32_t part);

/**
 * Makes the built-in camera `name` ("physical", "scsim-code", ...; `spikelane preset list` shows them): 400x250 pixels at 20 kHz.
 *
 * # Safety
 * `name` is NULL or a string; `camera` is NULL or can be written.
 */
spl_status spl_camera_preset(const char *name,
                             spl_camera **camera);

/**
 * Makes the camera that `toml`, the text of a camera file, describes. Maps that it names are looked for in `folder`;
 * NULL for a camera without maps.
 *
 * # Safety
 * `toml` and `folder` are NULL or strings; `camera` is NULL or can be written.
 */
spl_status spl_camera_parse(const char *toml,
                            const char *folder,
                            spl_camera **camera);

/**
 * Makes the camera of the file `path` (.toml), with the maps beside it.
 *
 * # Safety
 * `path` is NULL or a string; `camera` is NULL or can be written.
 */
spl_status spl_camera_load(const char *path, spl_camera **camera);

/**
 * Makes a camera without imperfections that starts with empty pixels: `width` x `height` pixels, `readout_hz`
 * readouts per second.
 *
 * # Safety
 * `camera` is NULL or can be written.
 */
spl_status spl_camera_ideal(uint32_t width, uint32_t height, double readout_hz, spl_camera **camera);

/**
 * Makes a copy of a camera.
 *
 * # Safety
 * `camera` is NULL or a handle; `copy` is NULL or can be written.
 */
spl_status spl_camera_copy(const spl_camera *camera, spl_camera **copy);

/**
 * Makes the noise-free twin of a camera: the same sensor, clamp and start phase, and no other effect.
 *
 * # Safety
 * `camera` is NULL or a handle; `twin` is NULL or can be written.
 */
spl_status spl_camera_clean_twin(const spl_camera *camera, spl_camera **twin);

/**
 * Makes the camera that is a rectangle of another, `width` x `height` pixels from column `col` and row `row` on, with the
 * pixels, columns and rows of that place.
 *
 * # Safety
 * `camera` is NULL or a handle; `window` is NULL or can be written.
 */
spl_status spl_camera_window(const spl_camera *camera,
                             uint32_t col,
                             uint32_t row,
                             uint32_t width,
                             uint32_t height,
                             spl_camera **window);

/**
 * Gives a camera another number of pixels; its fixed pattern is drawn anew. Refused for a window and for a camera with
 * maps.
 *
 * # Safety
 * `camera` is NULL or a handle.
 */
spl_status spl_camera_resize(spl_camera *camera,
                             uint32_t width,
                             uint32_t height);

/**
 * Sets the parameter `key` of the effect `effect` to `value`, a text as in camera files: "0.02", "6.36 mV". An effect that
 * the camera lacks is added, its other parameters neutral. `spikelane effects` lists names, keys and units.
 *
 * # Safety
 * `camera` is NULL or a handle; `effect`, `key` and `value` are NULL or strings.
 */
spl_status spl_camera_set_effect(spl_camera *camera,
                                 const char *effect,
                                 const char *key,
                                 const char *value);

/**
 * As spl_camera_set_effect, with a number in the parameter's own unit.
 *
 * # Safety
 * `camera` is NULL or a handle; `effect` and `key` are NULL or strings.
 */
spl_status spl_camera_set_effect_number(spl_camera *camera,
                                        const char *effect,
                                        const char *key,
                                        double value);

/**
 * Takes an effect from a camera; one that it lacks changes nothing.
 *
 * # Safety
 * `camera` is NULL or a handle; `effect` is NULL or a string.
 */
spl_status spl_camera_without(spl_camera *camera, const char *effect);

/**
 * Sets a number of the circuit: "readout_hz" (readouts per second), "capacitance_ff" (fF), "swing_v" (V), or
 * "thresholds_at_full_scale" (nominal thresholds that full-scale light adds per readout: the exposure).
 *
 * # Safety
 * `camera` is NULL or a handle; `key` is NULL or a string.
 */
spl_status spl_camera_set_sensor(spl_camera *camera, const char *key, double value);

/**
 * Gives a camera a measured map in place of what effects would draw: "gain" (relative to the nominal one), "dark_pa" (pA),
 * "capacitance_ff" (fF) or "swing_v" (V); `count` values, one per pixel of the whole sensor, row by row.
 *
 * # Safety
 * `camera` is NULL or a handle; `map` is NULL or a string; `values` is NULL or has `count` values.
 */
spl_status spl_camera_set_map(spl_camera *camera,
                              const char *map,
                              const double *values,
                              uintptr_t count);

/**
 * Says how many pixels a camera has, and how many readouts per second; NULL for what nobody asks.
 *
 * # Safety
 * `camera` is NULL or a handle; `width`, `height` and `readout_hz` are NULL or can be written.
 */
spl_status spl_camera_size(const spl_camera *camera, uint32_t *width, uint32_t *height, double *readout_hz);

/**
 * Frees a camera; simulators made from it go on. NULL is SPL_OK.
 *
 * # Safety
 * `camera` is NULL or a handle.
 */
spl_status spl_camera_free(spl_camera *camera);

/**
 * Makes a simulator of a camera: all that cannot be simulated is refused here. `seeds` fix the noise; NULL for zeros.
 * Light beyond `greatest_light` full scales, which only SPL_F32 holds, is cut; 1.0 is usual. `threads` of its own share the
 * work, from 1 (the caller's) to 4096.
 *
 * # Safety
 * `camera` is NULL or a handle; `seeds` is NULL or can be read; `simulator` is NULL or can be written.
 */
spl_status spl_simulator_new(const spl_camera *camera,
                             const spl_seeds *seeds,
                             double greatest_light,
                             uint32_t threads,
                             spl_simulator **simulator);

/**
 * Makes a copy of a simulator that goes on from the same readout on its own; its threads are shared.
 *
 * # Safety
 * `simulator` is NULL or a handle; `copy` is NULL or can be written.
 */
spl_status spl_simulator_copy(const spl_simulator *simulator, spl_simulator **copy);

/**
 * Asks for an instruction set: "reference", "portable", "sse4.1", "avx2", "avx512", or "auto" for the fastest. The bits stay the same.
 *
 * # Safety
 * `simulator` is NULL or a handle; `backend` is NULL or a string.
 */
spl_status spl_simulator_set_backend(spl_simulator *simulator,
                                     const char *backend);

/**
 * Says which instruction set is used: one of the names of spl_simulator_set_backend, a string that is never freed.
 *
 * # Safety
 * `simulator` is NULL or a handle; `backend` is NULL or can be written.
 */
spl_status spl_simulator_backend(const spl_simulator *simulator,
                                 const char **backend);

/**
 * Says how many bytes a packed readout has.
 *
 * # Safety
 * `simulator` is NULL or a handle; `bytes` is NULL or can be written.
 */
spl_status spl_simulator_frame_bytes(const spl_simulator *simulator, uintptr_t *bytes);

/**
 * Says which readout comes next, counted from 0.
 *
 * # Safety
 * `simulator` is NULL or a handle; `readout` is NULL or can be written.
 */
spl_status spl_simulator_readout(const spl_simulator *simulator, uint64_t *readout);

/**
 * Begins another recording of the same camera at readout 0: far quicker than a new simulator. `seeds->camera` has to
 * be that of spl_simulator_new; NULL for zeros.
 *
 * # Safety
 * `simulator` is NULL or a handle; `seeds` is NULL or can be read.
 */
spl_status spl_simulator_restart(spl_simulator *simulator,
                                 const spl_seeds *seeds);

/**
 * Frees a simulator. NULL is SPL_OK.
 *
 * # Safety
 * `simulator` is NULL or a handle.
 */
spl_status spl_simulator_free(spl_simulator *simulator);

/**
 * Holds `frame` for `readouts` readouts and writes them, packed, to `out`: `out_bytes` is `readouts` times
 * spl_simulator_frame_bytes. Many readouts a call are faster than one: 128 make a batch. A camera that drops readouts holds
 * the light until `out` is full; spl_expose_frames lets the scene go on instead.
 *
 * # Safety
 * `simulator` is NULL or a handle; `frame` is NULL or says the truth; `out` is NULL or has `out_bytes` bytes that can be
 * written. Memory of the frame that overlaps `out` is refused. No other thread changes either during the call.
 */
spl_status spl_push(spl_simulator *simulator,
                    const spl_frame *frame,
                    uintptr_t readouts,
                    uint8_t *out,
                    uintptr_t out_bytes);

/**
 * Goes from one frame to another in a straight line: readout i of `readouts` sees `from` + (`to` - `from`) * i /
 * `readouts`. To go on, the next call's `from` is this call's `to`. Otherwise as spl_push.
 *
 * # Safety
 * As spl_push, for both frames.
 */
spl_status spl_push_between(spl_simulator *simulator,
                            const spl_frame *from,
                            const spl_frame *to,
                            uintptr_t readouts,
                            uint8_t *out,
                            uintptr_t out_bytes);

/**
 * Runs `count` frames, each of which lasts `readouts_per_frame` readouts, for `readouts` readouts, at most as many as
 * they last. `insertion` says what the light does between two of them: SPL_HOLD, SPL_LINEAR or SPL_FLOW; the last frame stays. With a
 * new frame at every readout this is several times faster than a call for each. Otherwise as spl_push.
 *
 * # Safety
 * As spl_push; `frames` is NULL or has `count` frames that say the truth.
 */
spl_status spl_push_frames(spl_simulator *simulator,
                           const spl_frame *frames,
                           uintptr_t count,
                           uint64_t readouts_per_frame,
                           uint32_t insertion,
                           uintptr_t readouts,
                           uint8_t *out,
                           uintptr_t out_bytes);

/**
 * As spl_push_frames, but readouts that the camera drops (effect "dropped_readouts") are missing: `*written` says how many
 * readouts at the start of `out` are filled.
 *
 * # Safety
 * As spl_push_frames; `written` is NULL or can be written.
 */
spl_status spl_expose_frames(spl_simulator *simulator,
                             const spl_frame *frames,
                             uintptr_t count,
                             uint64_t readouts_per_frame,
                             uint32_t insertion,
                             uintptr_t readouts,
                             uint8_t *out,
                             uintptr_t out_bytes,
                             uintptr_t *written);

/**
 * Says how many bytes spl_state_save writes.
 *
 * # Safety
 * `simulator` is NULL or a handle; `bytes` is NULL or can be written.
 */
spl_status spl_state_bytes(const spl_simulator *simulator, uintptr_t *bytes);

/**
 * Writes all that a camera remembers, and what it belongs to, to `state`; `state_bytes` is what spl_state_bytes says.
 * Python's `Simulator.restore` reads it too.
 *
 * # Safety
 * `simulator` is NULL or a handle; `state` is NULL or has `state_bytes` bytes that can be written.
 */
spl_status spl_state_save(const spl_simulator *simulator,
                          uint8_t *state,
                          uintptr_t state_bytes);

/**
 * Goes on from a saved state with the same bits. The simulator has to be of the same camera, seeds and greatest light.
 *
 * # Safety
 * `simulator` is NULL or a handle; `state` is NULL or has `state_bytes` bytes.
 */
spl_status spl_state_restore(spl_simulator *simulator,
                             const uint8_t *state,
                             uintptr_t state_bytes);

/**
 * Makes of every bit of packed readouts of `width` x `height` pixels a byte of 0 or 1: `bits_bytes` is `width` * `height`
 * for each readout.
 *
 * # Safety
 * `packed` is NULL or has `packed_bytes` bytes; `bits` is NULL or has `bits_bytes` bytes that can be written.
 */
spl_status spl_unpack(uint32_t width,
                      uint32_t height,
                      const uint8_t *packed,
                      uintptr_t packed_bytes,
                      uint8_t *bits,
                      uintptr_t bits_bytes);

/**
 * Begins a stream of readouts of `width` x `height` pixels that will be the file `path`. `layout` is NULL for "dat", or
 * another of the names that `spikelane convert --help` lists. A file of that name is replaced if `force` is not 0, and otherwise
 * refused with SPL_EXISTS. The file gets its name from spl_writer_finish.
 *
 * # Safety
 * `path` and `layout` are NULL or strings; `writer` is NULL or can be written.
 */
spl_status spl_writer_create(const char *path,
                             uint32_t width,
                             uint32_t height,
                             const char *layout,
                             int32_t force,
                             spl_writer **writer);

/**
 * Appends packed readouts.
 *
 * # Safety
 * `writer` is NULL or a handle; `packed` is NULL or has `packed_bytes` bytes.
 */
spl_status spl_writer_write(spl_writer *writer, const uint8_t *packed, uintptr_t packed_bytes);

/**
 * Brings the stream to the disk and gives the file its name. A stream without readouts, or one that fails here, leaves no file.
 * Nothing can be written any more; the handle is still to be freed.
 *
 * # Safety
 * `writer` is NULL or a handle.
 */
spl_status spl_writer_finish(spl_writer *writer);

/**
 * Frees a writer; a stream that was not finished leaves no file. NULL is SPL_OK.
 *
 * # Safety
 * `writer` is NULL or a handle.
 */
spl_status spl_writer_free(spl_writer *writer);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* SPIKELANE_H */
