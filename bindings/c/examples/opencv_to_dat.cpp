// opencv_to_dat VIDEO OUT.dat [READOUTS_PER_FRAME]: reads a video with OpenCV, simulates a camera and writes the readouts.
#include <cmath>
#include <iostream>

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>
#include <spikelane.hpp>

namespace {

// Returns a table from video codes to linear light, which inverts the sRGB curve.
cv::Mat linear() {
    cv::Mat table(1, 256, CV_32F);
    for (int code = 0; code < 256; code++) {
        const float c = float(code) / 255;
        table.at<float>(code) = c <= 0.04045f ? c / 12.92f : std::pow((c + 0.055f) / 1.055f, 2.4f);
    }
    return table;
}

// Reads the next image, scales its luminance to the size of the camera, and returns false at the end of the video. Weights the
// colors and averages the pixels in linear light, because a weighted sum of codes is too dark for saturated colors.
bool read(cv::VideoCapture &video, const spikelane::Camera &camera, std::vector<float> &light) {
    static const cv::Mat table = linear();
    static const cv::Matx13f weights(0.0722f, 0.7152f, 0.2126f); // blue, green, red
    cv::Mat picture, colors, gray, small;
    if (!video.read(picture)) return false;
    cv::LUT(picture, table, colors);
    cv::transform(colors, gray, weights);
    cv::resize(gray, small, cv::Size(int(camera.width()), int(camera.height())), 0, 0, cv::INTER_AREA);
    light.assign(small.begin<float>(), small.end<float>());
    return true;
}

} // namespace

int main(int argc, char **argv) try {
    if (argc < 3) return std::cerr << "usage: opencv_to_dat VIDEO OUT.dat [READOUTS_PER_FRAME]\n", 2;
    const auto readouts = std::uint32_t(argc > 3 ? std::stoul(argv[3]) : 20);
    cv::VideoCapture video(argv[1]);
    const auto camera = spikelane::Camera::preset("physical");
    spikelane::Simulator simulator(camera);
    spikelane::Writer writer(argv[2], camera.width(), camera.height());
    std::vector<std::uint8_t> packed(readouts * simulator.frame_bytes());
    std::vector<float> from, to;
    if (!read(video, camera, from)) return std::cerr << argv[1] << ": OpenCV cannot read an image\n", 4;
    while (read(video, camera, to)) {
        simulator.fill(spikelane::Light::linear(spikelane::frame(from), spikelane::frame(to), readouts), packed);
        writer.write(packed);
        from.swap(to);
    }
    // The light remains constant after the last image.
    simulator.fill(spikelane::frame(from), packed);
    writer.write(packed);
    writer.finish();
    std::cout << argv[2] << ": " << simulator.readout() << " readouts of " << camera.width() << "x" << camera.height() << "\n";
    return 0;
} catch (const std::exception &e) {
    std::cerr << e.what() << "\n";
    return 1;
}
