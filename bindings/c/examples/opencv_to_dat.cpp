// opencv_to_dat VIDEO OUT.dat [READOUTS_A_FRAME]: a video that OpenCV reads, as the readouts of a camera.
#include <cmath>
#include <iostream>

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>
#include <spikelane.hpp>

namespace {

// Codes of a video as linear light: the sRGB curve undone, with 16 bits so that dark codes stay apart.
std::vector<std::uint16_t> linear() {
    std::vector<std::uint16_t> table(256);
    for (int code = 0; code < 256; code++) {
        const double c = code / 255.0;
        const double light = c <= 0.04045 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4);
        table[std::size_t(code)] = std::uint16_t(std::lround(65535 * light));
    }
    return table;
}

// The next picture in grey and of the camera's size; false at the end.
bool read(cv::VideoCapture &video, const spikelane::Camera &camera, std::vector<std::uint16_t> &light) {
    static const auto table = linear();
    cv::Mat picture, small, grey;
    if (!video.read(picture)) return false;
    cv::resize(picture, small, cv::Size(int(camera.width()), int(camera.height())), 0, 0, cv::INTER_AREA);
    cv::cvtColor(small, grey, cv::COLOR_BGR2GRAY);
    light.clear();
    for (int row = 0; row < grey.rows; row++)
        for (int col = 0; col < grey.cols; col++) light.push_back(table[grey.at<std::uint8_t>(row, col)]);
    return true;
}

} // namespace

int main(int argc, char **argv) try {
    if (argc < 3) return std::cerr << "usage: opencv_to_dat VIDEO OUT.dat [READOUTS_A_FRAME]\n", 2;
    const std::size_t readouts = argc > 3 ? std::stoul(argv[3]) : 20;
    cv::VideoCapture video(argv[1]);
    const auto camera = spikelane::Camera::preset("physical");
    spikelane::Simulator simulator(camera);
    spikelane::Writer writer(argv[2], camera.width(), camera.height());
    std::vector<std::uint8_t> packed(readouts * simulator.frame_bytes());
    std::vector<std::uint16_t> from, to;
    if (!read(video, camera, from)) return std::cerr << argv[1] << ": no picture that OpenCV can read\n", 4;
    while (read(video, camera, to)) {
        simulator.push_between(spikelane::frame(from), spikelane::frame(to), packed);
        writer.write(packed);
        from.swap(to);
    }
    // The last picture stays.
    simulator.push(spikelane::frame(from), packed);
    writer.write(packed);
    writer.finish();
    std::cout << argv[2] << ": " << simulator.readout() << " readouts of " << camera.width() << "x" << camera.height() << "\n";
    return 0;
} catch (const std::exception &e) {
    std::cerr << e.what() << "\n";
    return 1;
}
