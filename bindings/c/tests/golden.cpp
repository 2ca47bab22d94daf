// golden TABLE: simulates every row of the golden table with the C++ interface. For most rows, restores a saved state after
// half of the readouts.
#include <iostream>

#include "golden.h"
#include "spikelane.hpp"

using namespace spikelane;

namespace {

struct Samples {
    std::vector<std::uint8_t> narrow, back;
    std::vector<std::uint16_t> wide;
    std::vector<float> bright, dark;
    explicit Samples(std::size_t n) : dark(n, 0.0f) {
        for (std::size_t p = 0; p < n; p++) {
            narrow.push_back(golden_ramp(p, n));
            wide.push_back(golden_wide(p, n));
            bright.push_back(golden_bright(p, n));
        }
        back.assign(narrow.rbegin(), narrow.rend());
    }
};

void run(Simulator &simulator, const std::string &kind, const Samples &light, View<std::uint8_t> out) {
    if (kind == "between")
        return simulator.fill(Light::linear(frame(light.narrow), frame(light.back), GOLDEN_READOUTS), out);
    if (kind == "bright") {
        const std::size_t lit = 150 * simulator.frame_bytes();
        simulator.fill(frame(light.bright), {out.data(), lit});
        return simulator.fill(frame(light.dark), {out.data() + lit, out.size() - lit});
    }
    // Saves the state after half of the readouts, restarts the simulator, and continues from the saved state.
    const std::size_t half = 100 * simulator.frame_bytes();
    const spl_frame held = kind == "u16" ? frame(light.wide) : frame(light.narrow);
    simulator.fill(held, {out.data(), half});
    const auto state = simulator.state();
    simulator.restart({11, 1, 2});
    simulator.restart({11, 22, 33});
    simulator.restore(state);
    simulator.fill(held, {out.data() + half, out.size() - half});
}

std::string digest(const std::vector<std::uint8_t> &bytes) {
    char text[19];
    std::snprintf(text, sizeof text, "0x%016llx", (unsigned long long)golden_fnv1a(bytes.data(), bytes.size()));
    return text;
}

void expect(bool good, const char *what) {
    if (!good) throw std::logic_error(what);
}

void errors() {
    try {
        Camera::preset("phisical");
    } catch (const Error &e) {
        expect(e.status == SPL_CONFIG && e.found == "\"phisical\"" && e.remedy == "did you mean physical?", e.what());
        return;
    }
    throw std::logic_error("no exception for an unknown preset");
}

// `run`, `fill` and `advance` produce the same readouts; `advance` writes no dropped readouts.
void runs() {
    Camera camera = Camera::ideal(40, 30).set_effect("shot_noise", "photons_at_full_scale", 500.0);
    std::vector<std::uint8_t> bright(40 * 30, 90), dark(40 * 30, 20);
    const Light lights[] = {frame(bright), Light::linear(frame(bright), frame(dark), 60),
                            Light::sequence({frame(bright), frame(dark), frame(bright)}, 20)};
    for (const Light &light : lights) {
        Simulator one(camera), two(camera), three(camera);
        const auto packed = one.run(light, 60);
        std::vector<std::uint8_t> filled(packed.size()), advanced(packed.size());
        two.fill(light, filled);
        expect(three.advance(light, 60, advanced) == 60, "a camera that drops no readout");
        expect(packed == filled && packed == advanced, "run, fill and advance differ");
    }
    camera.set_effect("dropped_readouts", "probability", 0.3);
    Simulator dropping(camera);
    std::vector<std::uint8_t> out(60 * dropping.frame_bytes());
    const std::size_t written = dropping.advance(lights[0], 60, out);
    expect(written > 10 && written < 60 && dropping.readout() == 60, "a camera that drops readouts");
}

void moves() {
    Camera camera = Camera::ideal(40, 30).set_effect("prnu", "sigma", 0.02).set_effect("dark_current", "mean", "0.5 pA");
    Camera moved = std::move(camera);
    expect(moved.width() == 40 && moved.height() == 30 && moved.readout_hz() == 20000.0, "a camera that was moved");
    Camera other = moved;
    other.resize(3, 4);
    expect(other.width() == 3 && moved.width() == 40, "a copy that was changed");
    expect(moved.window(1, 2, 8, 4).width() == 8 && moved.clean_twin().height() == 30, "a window or a clean twin");
    Simulator one(moved);
    Simulator two = std::move(one);
    std::vector<std::uint8_t> light(40 * 30, 51);
    expect(two.run(frame(light), 10).size() == 10 * two.frame_bytes(), "the size of packed readouts");
    expect(two.readout() == 10, "a simulator that was moved");
    try {
        camera.resize(1, 1);
    } catch (const Error &e) {
        expect(e.status == SPL_USAGE, e.what());
        return;
    }
    throw std::logic_error("no exception for a camera after a move");
}

} // namespace

int main(int argc, char **argv) try {
    if (argc < 2) return std::cerr << "usage: golden TABLE\n", 2;
    static golden_table table;
    golden_read(argv[1], &table);
    for (std::size_t i = 0; i < table.count; i++) {
        const golden_row &row = table.rows[i];
        const Camera camera = Camera::from_toml(row.camera);
        Simulator simulator(camera, {11, 22, 33}, 1.6);
        std::vector<std::uint8_t> out(GOLDEN_READOUTS * simulator.frame_bytes());
        run(simulator, row.light, Samples(std::size_t(camera.width()) * camera.height()), out);
        if (digest(out) != row.fnv1a) throw std::logic_error(std::string(row.name) + ": " + digest(out));
    }
    std::free(table.text);
    errors();
    moves();
    runs();
    std::cout << "golden.cpp: " << table.count << " rows\n";
    return 0;
} catch (const std::exception &e) {
    std::cerr << "golden.cpp: " << e.what() << "\n";
    return 1;
}
