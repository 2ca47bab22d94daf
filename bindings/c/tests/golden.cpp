// golden TABLE: every row of the golden table through the C++ wrapper, in one piece and resumed half-way.
#include <iostream>

#include "golden.h"
#include "spikelane.hpp"

using namespace spikelane;

namespace {

struct Light {
    std::vector<std::uint8_t> narrow, back;
    std::vector<std::uint16_t> wide;
    std::vector<float> bright, dark;
    explicit Light(std::size_t n) : dark(n, 0.0f) {
        for (std::size_t p = 0; p < n; p++) {
            narrow.push_back(golden_ramp(p, n));
            wide.push_back(golden_wide(p, n));
            bright.push_back(golden_bright(p, n));
        }
        back.assign(narrow.rbegin(), narrow.rend());
    }
};

void run(Simulator &simulator, const std::string &kind, const Light &light, View<std::uint8_t> out) {
    if (kind == "between") return simulator.push_between(frame(light.narrow), frame(light.back), out);
    if (kind == "bright") {
        const std::size_t lit = 150 * simulator.frame_bytes();
        simulator.push(frame(light.bright), {out.data(), lit});
        return simulator.push(frame(light.dark), {out.data() + lit, out.size() - lit});
    }
    // Half of it in another simulator, which goes on from the state of this one.
    const std::size_t half = 100 * simulator.frame_bytes();
    const spl_frame held = kind == "u16" ? frame(light.wide) : frame(light.narrow);
    simulator.push(held, {out.data(), half});
    const auto state = simulator.state();
    simulator.restart({11, 1, 2});
    simulator.restart({11, 22, 33});
    simulator.restore(state);
    simulator.push(held, {out.data() + half, out.size() - half});
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
    throw std::logic_error("no exception for a preset that there is not");
}

void moves() {
    Camera camera = Camera::ideal(40, 30).set_effect("prnu", "sigma", 0.02).set_effect("dark_current", "mean", "0.5 pA");
    Camera moved = std::move(camera);
    expect(moved.width() == 40 && moved.height() == 30 && moved.readout_hz() == 20000.0, "a camera that was moved");
    Camera other = moved;
    other.resize(3, 4);
    expect(other.width() == 3 && moved.width() == 40, "a copy that was changed");
    expect(moved.window(1, 2, 8, 4).width() == 8 && moved.clean_twin().height() == 30, "a part of it");
    Simulator one(moved);
    Simulator two = std::move(one);
    std::vector<std::uint8_t> light(40 * 30, 51), out(10 * two.frame_bytes());
    two.push(frame(light), out);
    expect(two.readout() == 10, "a simulator that was moved");
    try {
        camera.resize(1, 1);
    } catch (const Error &e) {
        expect(e.status == SPL_USAGE, e.what());
        return;
    }
    throw std::logic_error("no exception for what was moved away");
}

} // namespace

int main(int argc, char **argv) try {
    if (argc < 2) return std::cerr << "usage: golden TABLE\n", 2;
    static golden_table table;
    golden_read(argv[1], &table);
    for (std::size_t i = 0; i < table.count; i++) {
        const golden_row &row = table.rows[i];
        const Camera camera = Camera::parse(row.camera);
        Simulator simulator(camera, {11, 22, 33}, 1.6);
        std::vector<std::uint8_t> out(GOLDEN_READOUTS * simulator.frame_bytes());
        run(simulator, row.light, Light(std::size_t(camera.width()) * camera.height()), out);
        if (digest(out) != row.fnv1a) throw std::logic_error(std::string(row.name) + ": " + digest(out));
    }
    std::free(table.text);
    errors();
    moves();
    std::cout << "golden.cpp: " << table.count << " rows\n";
    return 0;
} catch (const std::exception &e) {
    std::cerr << "golden.cpp: " << e.what() << "\n";
    return 1;
}
