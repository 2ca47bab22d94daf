// C++17 interface of spikelane: owning classes, views and exceptions for the functions of spikelane.h. That header describes
// each function.
#ifndef SPIKELANE_HPP
#define SPIKELANE_HPP

#include <cstddef>
#include <cstdint>
#include <memory>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "spikelane.h"

namespace spikelane {

// The exception for a failed call; what() returns the whole message.
class Error : public std::runtime_error {
public:
    Error()
        : std::runtime_error(spl_last_error(SPL_ERROR_MESSAGE)), status(spl_last_status()),
          subject(spl_last_error(SPL_ERROR_SUBJECT)), found(spl_last_error(SPL_ERROR_FOUND)),
          expected(spl_last_error(SPL_ERROR_EXPECTED)), remedy(spl_last_error(SPL_ERROR_REMEDY)) {}
    spl_status status;
    std::string subject, found, expected, remedy;
};

inline void check(spl_status status) {
    if (status != SPL_OK) throw Error();
}

// A borrowed array, like std::span of C++20.
template <class T> class View {
public:
    View() = default;
    View(T *data, std::size_t size) : data_(data), size_(size) {}
    template <class Container, class = decltype(std::declval<Container &>().data())>
    View(Container &values) : data_(values.data()), size_(values.size()) {}
    T *data() const { return data_; }
    std::size_t size() const { return size_; }
    T *begin() const { return data_; }
    T *end() const { return data_ + size_; }
    T &operator[](std::size_t at) const { return data_[at]; }

private:
    T *data_ = nullptr;
    std::size_t size_ = 0;
};

// Returns a frame of linear light. `stride` is the number of samples between the starts of two rows; 0 stands for rows without
// gaps.
template <class T> spl_frame frame(View<T> samples, std::size_t stride = 0) {
    using Sample = std::remove_const_t<T>;
    static_assert(std::is_same_v<Sample, std::uint8_t> || std::is_same_v<Sample, std::uint16_t> ||
                      std::is_same_v<Sample, float>,
                  "light is uint8_t, uint16_t or float");
    const std::uint32_t type =
        std::is_same_v<Sample, std::uint8_t> ? SPL_U8 : std::is_same_v<Sample, std::uint16_t> ? SPL_U16 : SPL_F32;
    return spl_frame{samples.data(), samples.size() * sizeof(T), stride, type};
}

template <class T> spl_frame frame(const std::vector<T> &samples, std::size_t stride = 0) {
    return frame(View<const T>(samples), stride);
}

template <class Handle, spl_status (*Free)(Handle *)> struct Deleter {
    void operator()(Handle *handle) const { Free(handle); }
};

// The light of a call. The object owns its list of frames, but not the samples of the frames.
class Light {
public:
    // Constant light: every readout sees `frame`. A frame converts implicitly.
    Light(const spl_frame &frame) : frames_{frame} {}
    static Light hold(const spl_frame &frame) { return Light(frame); }
    // Linear change: readout i of `readouts` sees `from` + (`to` - `from`) * i / `readouts`.
    static Light linear(const spl_frame &from, const spl_frame &to, std::uint32_t readouts) {
        return Light({from, to}, readouts, SPL_INTERPOLATION_LINEAR);
    }
    // A sequence of frames; each frame lasts `readouts_per_frame` readouts.
    static Light sequence(std::vector<spl_frame> frames, std::uint32_t readouts_per_frame,
                          std::uint32_t interpolation = SPL_INTERPOLATION_HOLD) {
        return Light(std::move(frames), readouts_per_frame, interpolation);
    }
    // Returns the light for the C functions. The result is valid while this object exists.
    spl_light get() const { return spl_light{frames_.data(), frames_.size(), readouts_per_frame_, interpolation_}; }

private:
    Light(std::vector<spl_frame> frames, std::uint32_t readouts_per_frame, std::uint32_t interpolation)
        : frames_(std::move(frames)), readouts_per_frame_(readouts_per_frame), interpolation_(interpolation) {}
    std::vector<spl_frame> frames_;
    std::uint32_t readouts_per_frame_ = 0, interpolation_ = SPL_INTERPOLATION_HOLD;
};

class Camera {
public:
    Camera(Camera &&) = default;
    Camera &operator=(Camera &&) = default;
    Camera(const Camera &other) : Camera(make([&](spl_camera **to) { return spl_camera_copy(other.get(), to); })) {}
    Camera &operator=(const Camera &other) { return *this = Camera(other); }
    static Camera preset(const std::string &name) {
        return make([&](spl_camera **to) { return spl_camera_preset(name.c_str(), to); });
    }
    static Camera load(const std::string &path) {
        return make([&](spl_camera **to) { return spl_camera_load(path.c_str(), to); });
    }
    static Camera from_toml(const std::string &toml, const char *folder = nullptr) {
        return make([&](spl_camera **to) { return spl_camera_from_toml(toml.c_str(), folder, to); });
    }
    static Camera ideal(std::uint32_t width, std::uint32_t height, double readout_hz = 20000.0) {
        return make([&](spl_camera **to) { return spl_camera_ideal(width, height, readout_hz, to); });
    }
    Camera window(std::uint32_t col, std::uint32_t row, std::uint32_t width, std::uint32_t height) const {
        return make([&](spl_camera **to) { return spl_camera_window(get(), col, row, width, height, to); });
    }
    Camera clean_twin() const {
        return make([&](spl_camera **to) { return spl_camera_clean_twin(get(), to); });
    }
    Camera &resize(std::uint32_t width, std::uint32_t height) {
        return check(spl_camera_resize(get(), width, height)), *this;
    }
    Camera &set_effect(const std::string &effect, const std::string &key, const std::string &value) {
        return check(spl_camera_set_effect(get(), effect.c_str(), key.c_str(), value.c_str())), *this;
    }
    Camera &set_effect(const std::string &effect, const std::string &key, double value) {
        return check(spl_camera_set_effect_number(get(), effect.c_str(), key.c_str(), value)), *this;
    }
    Camera &remove_effect(const std::string &effect) {
        return check(spl_camera_remove_effect(get(), effect.c_str())), *this;
    }
    Camera &set_sensor(const std::string &key, double value) {
        return check(spl_camera_set_sensor(get(), key.c_str(), value)), *this;
    }
    Camera &set_map(const std::string &map, View<const double> values) {
        return check(spl_camera_set_map(get(), map.c_str(), values.data(), values.size())), *this;
    }
    std::uint32_t width() const { return size().first; }
    std::uint32_t height() const { return size().second; }
    double readout_hz() const {
        double hz = 0;
        check(spl_camera_size(get(), nullptr, nullptr, &hz));
        return hz;
    }
    spl_camera *get() const { return handle_.get(); }

private:
    explicit Camera(spl_camera *handle) : handle_(handle) {}
    template <class Make> static Camera make(Make &&into) {
        spl_camera *handle = nullptr;
        check(into(&handle));
        return Camera(handle);
    }
    std::pair<std::uint32_t, std::uint32_t> size() const {
        std::pair<std::uint32_t, std::uint32_t> size;
        check(spl_camera_size(get(), &size.first, &size.second, nullptr));
        return size;
    }
    std::unique_ptr<spl_camera, Deleter<spl_camera, spl_camera_free>> handle_;
};

class Simulator {
public:
    explicit Simulator(const Camera &camera, spl_seeds seeds = {}, double max_light = 1.0, std::uint32_t threads = 1) {
        spl_simulator *handle = nullptr;
        check(spl_simulator_new(camera.get(), &seeds, max_light, threads, &handle));
        handle_.reset(handle);
        check(spl_simulator_frame_bytes(handle, &frame_bytes_));
    }
    void backend(const std::string &name) { check(spl_simulator_set_backend(get(), name.c_str())); }
    std::string backend() const {
        const char *name = nullptr;
        check(spl_simulator_backend(get(), &name));
        return name;
    }
    std::size_t frame_bytes() const { return frame_bytes_; }
    std::uint64_t readout() const {
        std::uint64_t readout = 0;
        check(spl_simulator_readout(get(), &readout));
        return readout;
    }
    void restart(spl_seeds seeds) { check(spl_simulator_restart(get(), &seeds)); }
    // Returns `readouts` packed readouts.
    std::vector<std::uint8_t> run(const Light &light, std::size_t readouts) {
        std::vector<std::uint8_t> packed(readouts * frame_bytes_);
        fill(light, packed);
        return packed;
    }
    // Fills `out` with packed readouts; the size of `out` determines the number of readouts.
    void fill(const Light &light, View<std::uint8_t> out) {
        const spl_light given = light.get();
        check(spl_simulator_run(get(), &given, out.size() / frame_bytes_, out.data(), out.size()));
    }
    // Simulates `readouts` readouts, writes all except dropped readouts to `out`, and returns the number of written readouts.
    std::size_t advance(const Light &light, std::size_t readouts, View<std::uint8_t> out) {
        const spl_light given = light.get();
        std::size_t written = 0;
        check(spl_simulator_advance(get(), &given, readouts, out.data(), out.size(), &written));
        return written;
    }
    std::vector<std::uint8_t> state() const {
        std::size_t bytes = 0;
        check(spl_simulator_state_bytes(get(), &bytes));
        std::vector<std::uint8_t> state(bytes);
        check(spl_simulator_state_save(get(), state.data(), state.size()));
        return state;
    }
    void restore(View<const std::uint8_t> state) {
        check(spl_simulator_state_restore(get(), state.data(), state.size()));
    }
    spl_simulator *get() const { return handle_.get(); }

private:
    std::unique_ptr<spl_simulator, Deleter<spl_simulator, spl_simulator_free>> handle_;
    std::size_t frame_bytes_ = 0;
};

// Writes a stream to a file. finish() creates the file under its name. A writer that is destroyed before finish() leaves no
// file.
class Writer {
public:
    Writer(const std::string &path, std::uint32_t width, std::uint32_t height, const char *layout = nullptr,
           bool force = false) {
        spl_writer *handle = nullptr;
        check(spl_writer_create(path.c_str(), width, height, layout, force, &handle));
        handle_.reset(handle);
    }
    void write(View<const std::uint8_t> packed) { check(spl_writer_write(handle_.get(), packed.data(), packed.size())); }
    void finish() { check(spl_writer_finish(handle_.get())); }

private:
    std::unique_ptr<spl_writer, Deleter<spl_writer, spl_writer_free>> handle_;
};

} // namespace spikelane

#endif
