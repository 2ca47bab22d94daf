/*
 * spikelane: simulates spike cameras. Light in, bit-packed readouts out.
 *
 * Made by cbindgen from bindings/c/src; do not edit.
 *
 * A pixel of a spike camera integrates light and fires when its charge reaches a threshold. The camera reads all pixels
 * 20,000 to 40,000 times per second, one bit each.
 *
 *     spl_camera *camera;                                       // sensor and noise
 *     spl_simulator *simulator;                                 // a running camera
 *     size_t bytes;                                             // of one packed readout
 *     if (spl_camera_preset("physical", &camera) != SPL_OK ||   // 400x250 pixels at 20 kHz
 *         spl_simulator_new(camera, NULL, 1.0, 1, &simulator) != SPL_OK ||
 *         spl_simulator_frame_bytes(simulator, &bytes) != SPL_OK)
 *         fprintf(stderr, "%s\n", spl_last_error(SPL_ERROR_MESSAGE));
 *     spl_frame frame = {gray, sizeof gray, 0, SPL_U8};         // uint8_t gray[250 * 400]
 *     spl_light light = {&frame, 1, 0, SPL_INTERPOLATION_HOLD}; // the same frame for all readouts
 *     spl_simulator_run(simulator, &light, 64, packed, 64 * bytes);
 *     spl_simulator_free(simulator);
 *     spl_camera_free(camera);
 *
 * Light is linear: proportional to the number of photons, not the code of an image file. Rows run from top to bottom.
 *
 * Packed readouts: bit p % 8 of byte p / 8, least significant first, is pixel p = row * width + col. A readout has
 * (width * height + 7) / 8 bytes; the bits after the last pixel are 0.
 *
 * Sizes and places are given as width before height and col before row.
 *
 * Errors. Every function that can fail returns an spl_status; SPL_OK is 0. After another value, spl_last_error()
 * returns for this thread the subject, what was found, what was expected and the remedy. A function that fails changes
 * nothing, unless its description differs; it sets a handle that it would have created to NULL.
 *
 * Handles. Free every handle once, with the function of its name that ends in _free, and do not use it afterwards, as
 * with free() of C. Functions return SPL_USAGE for NULL and for a handle of another type. Several threads may read a
 * camera at the same time. Different threads may use a simulator or writer in turn; a call during a call of another thread
 * returns SPL_USAGE and changes nothing.
 *
 * Strings are UTF-8 and end in NUL. Buffers come with their size in bytes, and a wrong size is an error.
 *
 * The library calls no function of the program, prints nothing except the message of a panic, reads only the environment
 * variable SPIKELANE_BACKEND, and starts threads only if `threads` is above 1. The same camera, seeds and light give the same
 * bits on every machine, backend and number of threads, in C, C++, Rust, Python and from the program `spikelane`.
 */


#ifndef SPIKELANE_H
#define SPIKELANE_H

#include <stddef.h>
#include <stdint.h>

/**
 * Version of the ABI. It changes if a program that was compiled with an earlier header could fail.
 */
#define SPL_ABI_VERSION 1

/**
 * Part of an error: the whole message in one line.
 */
#define SPL_ERROR_MESSAGE 0

/**
 * Part of an error: its subject, such as an argument, a key or a file.
 */
#define SPL_ERROR_SUBJECT 1

/**
 * Part of an error: what was found.
 */
#define SPL_ERROR_FOUND 2

/**
 * Part of an error: what was expected instead.
 */
#define SPL_ERROR_EXPECTED 3

/**
 * Part of an error: the action that solves the problem.
 */
#define SPL_ERROR_REMEDY 4

/**
 * Samples of uint8_t. Full scale is 255.
 */
#define SPL_U8 0

/**
 * Samples of uint16_t in the byte order of the machine. Full scale is 65535.
 */
#define SPL_U16 1

/**
 * Samples of float, finite and not negative. Full scale is 1.0.
 */
#define SPL_F32 2

/**
 * Between two frames, the light equals the light of the first frame.
 */
#define SPL_INTERPOLATION_HOLD 0

/**
 * Between two frames, the light is interpolated linearly.
 */
#define SPL_INTERPOLATION_LINEAR 1

/**
 * Between two frames, the light is interpolated along the estimated motion.
 */
#define SPL_INTERPOLATION_FLOW 2

/**
 * The status of a call. The numbers are the exit codes of the program `spikelane`.
 */
enum spl_status
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  /**
   * Success.
   */
  SPL_OK = 0,
  /**
   * An argument or a combination of arguments is invalid.
   */
  SPL_USAGE = 2,
  /**
   * A preset or camera file describes something impossible.
   */
  SPL_CONFIG = 3,
  /**
   * The bytes of an input do not have the declared format.
   */
  SPL_INPUT = 4,
  /**
   * The operating system cannot read or write.
   */
  SPL_IO = 5,
  /**
   * The result does not fit on the disk.
   */
  SPL_SPACE = 6,
  /**
   * The output exists and overwriting is not allowed.
   */
  SPL_EXISTS = 7,
  /**
   * A required program is missing or failed.
   */
  SPL_TOOL = 8,
  /**
   * Bytes do not match their stored digest.
   */
  SPL_CORRUPT = 9,
  /**
   * Another process is writing this output.
   */
  SPL_BUSY = 10,
  /**
   * The system cannot allocate an amount of memory that an input or an argument requires.
   */
  SPL_MEMORY = 11,
  /**
   * A defect of the library; please report it. Afterward, the handles of the call can only be freed.
   */
  SPL_PANIC = 101,
  /**
   * The user requested a stop.
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
 * A camera: a sensor with its effects and measured maps.
 */
typedef struct spl_camera spl_camera;

/**
 * A simulated camera. Its pixels keep their charge between calls.
 */
typedef struct spl_simulator spl_simulator;

/**
 * A stream of readouts that is being written to a file.
 */
typedef struct spl_writer spl_writer;

/**
 * The seeds of the noise.
 */
typedef struct {
  /**
   * Seed of the fixed pattern. It identifies an individual camera.
   */
  uint64_t camera;
  /**
   * Seed of the temporal noise and the start charge.
   */
  uint64_t shot;
  /**
   * Number of the recording. Recordings with equal seeds and different numbers have independent noise.
   */
  uint64_t sequence;
} spl_seeds;

/**
 * A frame of linear light. A call reads the frame and keeps no pointer to it.
 */
typedef struct {
  /**
   * Pointer to the first sample of the top row, aligned for the sample type.
   */
  const void *samples;
  /**
   * Number of readable bytes at `samples`.
   */
  uintptr_t samples_bytes;
  /**
   * Distance in samples between the starts of two rows. 0 means that rows have no gaps.
   */
  uintptr_t stride;
  /**
   * SPL_U8, SPL_U16 or SPL_F32.
   */
  uint32_t sample_type;
} spl_frame;

/**
 * The light that the readouts of a call see. The call reads it and does not keep it.
 */
typedef struct {
  /**
   * The first of `count` frames.
   */
  const spl_frame *frames;
  /**
   * Number of frames, at least 1.
   */
  uintptr_t count;
  /**
   * Readouts that each frame lasts. A call runs at most `count` times as many readouts. With 0, which needs `count` 1, the
   * frame is held for all readouts of the call.
   */
  uint32_t readouts_per_frame;
  /**
   * Light between two frames: SPL_INTERPOLATION_HOLD, SPL_INTERPOLATION_LINEAR or SPL_INTERPOLATION_FLOW. The last frame is
   * held. To continue a scene, pass the last frame of a call as the first frame of the next one.
   */
  uint32_t interpolation;
} spl_light;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

/**
 * Returns the ABI version of the library. It equals SPL_ABI_VERSION of the library's own header.
 *
 * A program must not use the library if this value differs from SPL_ABI_VERSION of the header that the program was
 * compiled with.
 */
uint32_t spl_abi_version(void);

/**
 * Returns the version of the library, such as "0.1.0".
 */
const char *spl_version(void);

/**
 * Returns the status of the last failed call of this thread, or SPL_OK if no call failed. A successful call does not
 * change this status.
 */
spl_status spl_last_status(void);

/**
 * Returns a part of the message of the last failed call of this thread.
 *
 * SPL_ERROR_MESSAGE is the whole message. SPL_ERROR_SUBJECT, SPL_ERROR_FOUND, SPL_ERROR_EXPECTED and SPL_ERROR_REMEDY
 * are parts of the message. A missing part is an empty string, never NULL. The string is valid until the next failed
 * call of this thread or until the end of this thread.
 */
const char *spl_last_error(uint32_t part);

/**
 * Creates the built-in camera `name` ("physical", "scsim-code", ...) with 400x250 pixels at 20 kHz. `spikelane preset list`
 * lists the names.
 *
 * # Safety
 * `name` is NULL or a string; `camera` is NULL or points to writable memory.
 */
spl_status spl_camera_preset(const char *name,
                             spl_camera **camera);

/**
 * Creates a camera from `toml`, the text of a camera file.
 *
 * The maps of the camera are read from `folder`. For a camera without maps, `folder` may be NULL.
 *
 * # Safety
 * `toml` and `folder` are NULL or strings; `camera` is NULL or points to writable memory.
 */
spl_status spl_camera_from_toml(const char *toml, const char *folder, spl_camera **camera);

/**
 * Creates the camera that the file `path` (.toml) describes. Maps are read from the folder of the file.
 *
 * # Safety
 * `path` is NULL or a string; `camera` is NULL or points to writable memory.
 */
spl_status spl_camera_load(const char *path, spl_camera **camera);

/**
 * Creates a camera without imperfections. Its pixels start without charge.
 *
 * The camera has `width` x `height` pixels and `readout_hz` readouts per second.
 *
 * # Safety
 * `camera` is NULL or points to writable memory.
 */
spl_status spl_camera_ideal(uint32_t width, uint32_t height, double readout_hz, spl_camera **camera);

/**
 * Creates a copy of a camera.
 *
 * # Safety
 * `camera` is NULL or a handle; `copy` is NULL or points to writable memory.
 */
spl_status spl_camera_copy(const spl_camera *camera, spl_camera **copy);

/**
 * Creates the noise-free twin of a camera. It has the same sensor, saturation clamp and start phase, but no other
 * effect.
 *
 * # Safety
 * `camera` is NULL or a handle; `twin` is NULL or points to writable memory.
 */
spl_status spl_camera_clean_twin(const spl_camera *camera,
                                 spl_camera **twin);

/**
 * Creates a camera for a rectangle of another camera. The rectangle has `width` x `height` pixels and starts at column
 * `col` and row `row`.
 *
 * The fixed pattern of the new camera equals the fixed pattern of the rectangle.
 *
 * # Safety
 * `camera` is NULL or a handle; `window` is NULL or points to writable memory.
 */
spl_status spl_camera_window(const spl_camera *camera,
                             uint32_t col,
                             uint32_t row,
                             uint32_t width,
                             uint32_t height,
                             spl_camera **window);

/**
 * Changes the number of pixels of a camera. The fixed pattern is drawn again.
 *
 * The call fails for a window and for a camera with maps.
 *
 * # Safety
 * `camera` is NULL or a handle.
 */
spl_status spl_camera_resize(spl_camera *camera, uint32_t width, uint32_t height);

/**
 * Sets parameter `key` of effect `effect` to `value`. The value is text as in camera files, such as "0.02" or "6.36 mV".
 *
 * If the camera lacks the effect, the effect is added with neutral values of its other parameters. `spikelane effects`
 * lists names, keys and units.
 *
 * # Safety
 * `camera` is NULL or a handle; `effect`, `key` and `value` are NULL or strings.
 */
spl_status spl_camera_set_effect(spl_camera *camera,
                                 const char *effect,
                                 const char *key,
                                 const char *value);

/**
 * Does the same as spl_camera_set_effect, but `value` is a number in the unit of the parameter.
 *
 * # Safety
 * `camera` is NULL or a handle; `effect` and `key` are NULL or strings.
 */
spl_status spl_camera_set_effect_number(spl_camera *camera,
                                        const char *effect,
                                        const char *key,
                                        double value);

/**
 * Removes an effect from a camera. If the camera lacks the effect, nothing changes.
 *
 * # Safety
 * `camera` is NULL or a handle; `effect` is NULL or a string.
 */
spl_status spl_camera_remove_effect(spl_camera *camera, const char *effect);

/**
 * Sets a property of the sensor.
 *
 * `key` is one of these: "readout_hz" (readouts per second), "capacitance_ff" (fF), "swing_v" (V), or
 * "thresholds_at_full_scale" (the exposure: nominal thresholds that full-scale light adds per readout).
 *
 * # Safety
 * `camera` is NULL or a handle; `key` is NULL or a string.
 */
spl_status spl_camera_set_sensor(spl_camera *camera, const char *key, double value);

/**
 * Sets a measured map of a camera. The map replaces a fixed pattern that effects draw.
 *
 * `map` is "gain" (relative to the nominal gain), "dark_pa" (pA), "capacitance_ff" (fF) or "swing_v" (V). `values`
 * contains `count` values, one per pixel of the whole sensor in row-major order.
 *
 * # Safety
 * `camera` is NULL or a handle; `map` is NULL or a string; `values` is NULL or points to `count` readable values.
 */
spl_status spl_camera_set_map(spl_camera *camera,
                              const char *map,
                              const double *values,
                              uintptr_t count);

/**
 * Gets the width, the height and the readouts per second of a camera. Each of the three pointers for results may be
 * NULL.
 *
 * # Safety
 * `camera` is NULL or a handle; `width`, `height` and `readout_hz` are NULL or point to writable memory.
 */
spl_status spl_camera_size(const spl_camera *camera,
                           uint32_t *width,
                           uint32_t *height,
                           double *readout_hz);

/**
 * Frees a camera. Simulators that were created from the camera remain valid. For NULL, the call does nothing and returns
 * SPL_OK.
 *
 * # Safety
 * `camera` is NULL or a handle.
 */
spl_status spl_camera_free(spl_camera *camera);

/**
 * Creates a simulator of a camera. The call fails if the camera cannot be simulated.
 *
 * `seeds` determines the noise, and NULL means that all seeds are 0. Light is clamped to `max_light` full scales. The
 * usual value is 1.0, and only SPL_F32 samples can exceed 1.0. `threads` is the number of threads, 1 to 4096. With 1,
 * the calling thread does all work.
 *
 * # Safety
 * `camera` is NULL or a handle; `seeds` is NULL or points to readable memory; `simulator` is NULL or points to writable memory.
 */
spl_status spl_simulator_new(const spl_camera *camera,
                             const spl_seeds *seeds,
                             double max_light,
                             uint32_t threads,
                             spl_simulator **simulator);

/**
 * Creates a copy of a simulator. The copy continues independently from the next readout. The copy and the original share
 * threads.
 *
 * # Safety
 * `simulator` is NULL or a handle; `copy` is NULL or points to writable memory.
 */
spl_status spl_simulator_copy(const spl_simulator *simulator,
                              spl_simulator **copy);

/**
 * Selects an instruction set: "reference", "portable", "sse4.1", "avx2", "avx512", or "auto" for the fastest.
 *
 * The simulated bits do not depend on the instruction set.
 *
 * # Safety
 * `simulator` is NULL or a handle; `backend` is NULL or a string.
 */
spl_status spl_simulator_set_backend(spl_simulator *simulator, const char *backend);

/**
 * Gets the name of the instruction set, as a static string. The names are those of spl_simulator_set_backend.
 *
 * # Safety
 * `simulator` is NULL or a handle; `backend` is NULL or points to writable memory.
 */
spl_status spl_simulator_backend(const spl_simulator *simulator, const char **backend);

/**
 * Gets the number of bytes of a packed readout.
 *
 * # Safety
 * `simulator` is NULL or a handle; `bytes` is NULL or points to writable memory.
 */
spl_status spl_simulator_frame_bytes(const spl_simulator *simulator, uintptr_t *bytes);

/**
 * Gets the index of the next readout. The first readout has index 0.
 *
 * # Safety
 * `simulator` is NULL or a handle; `readout` is NULL or points to writable memory.
 */
spl_status spl_simulator_readout(const spl_simulator *simulator, uint64_t *readout);

/**
 * Starts another recording of the same camera at readout 0. This is much faster than creating another simulator.
 *
 * `seeds->camera` must equal the camera seed that was passed to spl_simulator_new. NULL means that all seeds are 0.
 *
 * # Safety
 * `simulator` is NULL or a handle; `seeds` is NULL or points to readable memory.
 */
spl_status spl_simulator_restart(spl_simulator *simulator,
                                 const spl_seeds *seeds);

/**
 * Frees a simulator. For NULL, the call does nothing and returns SPL_OK.
 *
 * # Safety
 * `simulator` is NULL or a handle.
 */
spl_status spl_simulator_free(spl_simulator *simulator);

/**
 * Simulates `readouts` readouts of the constant light `frame` and writes the packed readouts to `out`.
 *
 * `out_bytes` is `readouts` times spl_simulator_frame_bytes. One call with many readouts is faster than many calls with
 * one readout. Internally, a batch has 128 readouts. If the camera drops readouts, the light is constant until `out` is
 * full. With spl_expose_frames, the light continues to change during dropped readouts.
 *
 * # Safety
 * `simulator` is NULL or a handle. `frame` is NULL or points to a readable frame. `samples` of this frame is NULL or
 * points to `samples_bytes` readable bytes. `out` is NULL or points to `out_bytes` writable bytes. The call rejects a
 * frame that overlaps `out`. During the call, no other thread may change the frame, the samples of the frame or `out`.
 */
spl_status spl_simulator_run(spl_simulator *simulator,
                             const spl_light *light,
                             uintptr_t readouts,
                             uint8_t *packed,
                             uintptr_t packed_bytes);

/**
 * Does the same as spl_push_frames, but does not write the readouts that the camera drops (effect "dropped_readouts").
 *
 * `*written` is the number of readouts that were written. The written readouts are at the start of `out`.
 *
 * # Safety
 * The conditions are those of spl_push_frames. In addition, `written` is NULL or points to writable memory.
 */
spl_status spl_simulator_advance(spl_simulator *simulator,
                                 const spl_light *light,
                                 uintptr_t readouts,
                                 uint8_t *packed,
                                 uintptr_t packed_bytes,
                                 uintptr_t *written);

/**
 * Gets the number of bytes that spl_state_save requires.
 *
 * # Safety
 * `simulator` is NULL or a handle; `bytes` is NULL or points to writable memory.
 */
spl_status spl_simulator_state_bytes(const spl_simulator *simulator, uintptr_t *bytes);

/**
 * Writes the state of all pixels and a fingerprint of the camera to `state`.
 *
 * `state_bytes` is the number from spl_state_bytes. Python's `Simulator.restore` reads this format too.
 *
 * # Safety
 * `simulator` is NULL or a handle; `state` is NULL or points to `state_bytes` writable bytes.
 */
spl_status spl_simulator_state_save(const spl_simulator *simulator, uint8_t *state, uintptr_t state_bytes);

/**
 * Restores a saved state. The following readouts have the bits that the saved simulator would have produced.
 *
 * The camera, the seeds and `max_light` of this simulator must equal those of the saved simulator.
 *
 * # Safety
 * `simulator` is NULL or a handle; `state` is NULL or points to `state_bytes` readable bytes.
 */
spl_status spl_simulator_state_restore(spl_simulator *simulator, const uint8_t *state, uintptr_t state_bytes);

/**
 * Unpacks packed readouts of `width` x `height` pixels. Each bit becomes a byte of 0 or 1.
 *
 * `bits_bytes` is `width` * `height` times the number of readouts.
 *
 * # Safety
 * `packed` is NULL or points to `packed_bytes` readable bytes; `bits` is NULL or points to `bits_bytes` writable bytes.
 */
spl_status spl_unpack(uint32_t width,
                      uint32_t height,
                      const uint8_t *packed,
                      uintptr_t packed_bytes,
                      uint8_t *bits,
                      uintptr_t bits_bytes);

/**
 * Creates a writer for a stream of readouts of `width` x `height` pixels.
 *
 * `path` is the file of the stream. `layout` is NULL for "dat", or another name that `spikelane convert --help` lists.
 * If the file exists, a nonzero `force` replaces the file. With `force` = 0, the call fails with SPL_EXISTS. The file
 * appears at `path` only after spl_writer_finish.
 * # Safety
 * `path` and `layout` are NULL or strings; `writer` is NULL or points to writable memory.
 */
spl_status spl_writer_create(const char *path,
                             uint32_t width,
                             uint32_t height,
                             const char *layout,
                             int32_t force,
                             spl_writer **writer);

/**
 * Appends packed readouts to a stream.
 *
 * # Safety
 * `writer` is NULL or a handle; `packed` is NULL or points to `packed_bytes` readable bytes.
 */
spl_status spl_writer_write(spl_writer *writer, const uint8_t *packed, uintptr_t packed_bytes);

/**
 * Flushes the stream to the disk and renames the file to its final path.
 *
 * If the stream has no readouts, or if this call fails, no file remains. After this call, the handle accepts no
 * readouts, but it must still be freed.
 *
 * # Safety
 * `writer` is NULL or a handle.
 */
spl_status spl_writer_finish(spl_writer *writer);

/**
 * Frees a writer. The file of an unfinished stream is deleted. For NULL, the call does nothing and returns SPL_OK.
 *
 * # Safety
 * `writer` is NULL or a handle.
 */
spl_status spl_writer_free(spl_writer *writer);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* SPIKELANE_H */
