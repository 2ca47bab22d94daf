"""Writes the golden vectors of the metrics with other programs.

    pip install numpy==2.4.6 scipy==1.17.1 scikit-image==0.26.0 pycocotools==2.0.11
    pip install opencv-python-headless==5.0.0.93
    pip install --no-deps trackeval==1.3.0 ssimulacra2==0.3.0
    pip download --no-deps spikezoo==0.2.3.7
    python make.py --spikezoo spikezoo-0.2.3.7-py3-none-any.whl --spikecv reconsturction.py

The file for `--spikecv` is `SpikeCV/metrics/reconsturction.py` of https://github.com/Zyj061/SpikeCV at commit 0c5f332.
The script runs functions of Spike-Zoo and SpikeCV without their imports, because these need PyTorch. It writes the JSON
files beside this script. Images, depths and displacements are whole numbers: a value is `code / 1000` in single precision.
"""

import argparse
import ast
import contextlib
import io
import json
import math
import pathlib
import struct
import tempfile
import zipfile
from importlib.metadata import version

import cv2
import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy import ndimage, stats
from skimage import color as skimage_color
from skimage import metrics as skimage_metrics

FOLDER = pathlib.Path(__file__).parent


def write(name, packages, metrics, **content):
    """Writes a file with the versions of the packages and of the metrics."""
    made = {package: version(package) for package in packages}
    text = {"packages": made, "metrics": dict.fromkeys(metrics, 1), **content}
    text = json.dumps(text, allow_nan=False, separators=(",", ":"))
    (FOLDER / f"{name}.json").write_text(text + "\n")


def functions(source, names, variables):
    """Returns functions of a Python source. `variables` replaces the imports of the source."""
    nodes = [n for n in ast.parse(source).body if isinstance(n, ast.FunctionDef) and n.name in names]
    space = dict(variables)
    exec(compile(ast.Module(nodes, []), "source", "exec"), space)
    return [space[name] for name in names]


def pixels(codes):
    return codes.astype(np.float32) / np.float32(1000)


# Images


class Tensor:
    """The methods of a PyTorch tensor that Spike-Zoo calls, with the arithmetic of NumPy in single precision."""

    is_cuda = False

    def __init__(self, array):
        self.array = np.asarray(array, np.float32)
        self.shape = self.array.shape

    def __mul__(self, x):
        return Tensor(self.array * np.float32(x))

    def __sub__(self, x):
        return Tensor(self.array - np.float32(x))

    def __getitem__(self, key):
        return Tensor(self.array[key])

    def clamp(self, low, high):
        return Tensor(np.clip(self.array, np.float32(low), np.float32(high)))

    def dim(self):
        return self.array.ndim

    def permute(self, *axes):
        return Tensor(self.array.transpose(axes))

    def detach(self):
        return self

    def cpu(self):
        return self

    def numpy(self):
        return self.array


class Torch:
    Tensor = Tensor


def spike_zoo(wheel):
    source = zipfile.ZipFile(wheel).read("spikezoo/metrics/__init__.py").decode()
    pairs = {
        "ssim": skimage_metrics.structural_similarity,
        "psnr": skimage_metrics.peak_signal_noise_ratio,
    }
    return functions(source, ["cal_metric_pair"], {"torch": Torch, "metric_pair_list": pairs})[0]


def spikecv(path):
    names = ["ssim", "calculate_psnr", "calculate_ssim"]
    variables = {"np": np, "cv2": cv2, "math": math}
    return functions(pathlib.Path(path).read_text(), names, variables)[1:]


def box_mean(image, radius):
    return ndimage.uniform_filter(image.astype(float), 2 * radius + 1, mode="nearest")


def detail(output, a, b):
    """Returns the detail slope and the high-pass noise from their definition."""
    both = (a.astype(float) + b) / 2
    inside = (slice(2, -2), slice(2, -2))
    x, y = (box_mean(image, 2)[inside].ravel() for image in (both, output))
    gain = np.polyfit(x, y, 1)[0]
    p, a, b = ((image - box_mean(image, 1))[inside].ravel() for image in (output, a, b))
    slope = (p @ (a + b)) / (2 * gain * (a @ b))
    rest = np.mean((p / gain - slope * (a + b) / 2) ** 2) - slope**2 * np.mean(((a - b) / 2) ** 2)
    return slope, math.sqrt(9 / 8 * max(rest, 0)) / both[inside].mean()


def scene(height, width):
    y, x = np.mgrid[:height, :width]
    return 0.5 + 0.3 * np.sin(0.4 * x) * np.cos(0.3 * y) + 0.1 * np.sin(1.7 * x + 0.9 * y)


def image_cases(random, arguments):
    zoo = spike_zoo(arguments.spikezoo)
    cv_psnr, cv_ssim = spikecv(arguments.spikecv)
    cases = []
    for height, width, noise, offset in [(24, 31, 0.05, 0), (33, 20, 0.2, 0), (16, 16, 0.01, 0.3), (19, 40, 0.6, 0)]:
        reference = np.clip(np.round(1000 * (offset + scene(height, width) * (1 - offset))), 0, 1000)
        output = np.round(reference + 1000 * noise * random.normal(size=reference.shape))
        # Values outside 0 to 1 are tested apart: SpikeCV does not define their codes.
        output = np.clip(output, 520 if offset else 0, 1000)
        other = np.round(reference + 20 * random.normal(size=reference.shape))
        x, y, z = pixels(output), pixels(reference), pixels(other)
        wide = {"data_range": 1.0}
        values = {
            "psnr": skimage_metrics.peak_signal_noise_ratio(y.astype(float), x.astype(float), **wide),
            "ssim": skimage_metrics.structural_similarity(
                y.astype(float), x.astype(float), gaussian_weights=True, sigma=1.5, use_sample_covariance=False, **wide
            ),
            "psnr_as_spike_zoo": zoo(Tensor(x), Tensor(y), "psnr"),
            "ssim_as_spike_zoo": zoo(Tensor(x), Tensor(y), "ssim"),
        }
        codes = [(image * 255).astype(np.uint8) for image in (x, y)]
        values["psnr_as_spikecv"] = cv_psnr(*codes)
        values["ssim_as_spikecv"] = cv_ssim(*codes)
        values["detail_slope"], values["high_pass_noise"] = detail(x, y, z)
        cases.append(
            {
                "width": width,
                "height": height,
                "output": output.astype(int).ravel().tolist(),
                "reference": reference.astype(int).ravel().tolist(),
                "other_observation": other.astype(int).ravel().tolist(),
                "values": {key: float(value) for key, value in values.items()},
            }
        )
    return cases


# Color images


def lab(image):
    """Returns CIELAB of linear sRGB with the matrix and the white of IEC 61966-2-1."""
    xyz = image @ np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]).T
    return skimage_color.xyz2lab(xyz / [0.9505, 1, 1.089] * skimage_color.xyz_tristimulus_values(illuminant="D65", observer="2"))


def color_cases(random):
    cases = []
    for height, width, noise in [(12, 17, 0.02), (20, 13, 0.2)]:
        planes = [scene(height, width), np.abs(scene(height, width) - 0.3), scene(height, width) ** 3]
        reference = np.clip(np.round(1000 * np.stack(planes, axis=-1)), 0, 1000)
        output = np.clip(np.round(reference + 1000 * noise * random.normal(size=reference.shape)), 0, 1000)
        x, y = pixels(output).astype(float), pixels(reference).astype(float)
        values = {"cpsnr": skimage_metrics.peak_signal_noise_ratio(y, x, data_range=1.0)}
        for i, name in enumerate(["red", "green", "blue"]):
            values[f"psnr_{name}"] = skimage_metrics.peak_signal_noise_ratio(y[..., i], x[..., i], data_range=1.0)
        values["ssim_color"] = skimage_metrics.structural_similarity(
            y, x, data_range=1.0, channel_axis=-1, gaussian_weights=True, sigma=1.5, use_sample_covariance=False
        )
        values["ciede2000"] = skimage_color.deltaE_ciede2000(lab(y), lab(x)).mean()
        cases.append(
            {
                "width": width,
                "height": height,
                "output": output.astype(int).ravel().tolist(),
                "reference": reference.astype(int).ravel().tolist(),
                "values": {key: float(value) for key, value in values.items()},
            }
        )
    return cases


# Noise levels


def patches(image, side, step):
    return sliding_window_view(image, (side, side))[::step, ::step].reshape(-1, side * side)


def noise_chen(image):
    values = np.sort(np.linalg.eigvalsh(np.cov(patches(image, 8, 3).T)))
    for n in range(len(values), 0, -1):
        mean = values[:n].mean()
        if (values[:n] > mean).sum() == (values[:n] < mean).sum():
            return math.sqrt(mean)


def noise_liu(image):
    side = 7
    pixel_count = side * side
    horizontal = ((image[:, 2:] - image[:, :-2]) / 2) ** 2
    vertical = ((image[2:] - image[:-2]) / 2) ** 2
    texture = sliding_window_view(horizontal, (side, side - 2)).sum((2, 3))
    texture = (texture + sliding_window_view(vertical, (side - 2, side)).sum((2, 3))).ravel()
    selected = patches(image, side, 1)
    variance = np.linalg.eigvalsh(np.cov(selected.T))[0]
    trace = 2 * side * (side - 2) * 0.5
    quantile = stats.gamma.ppf(1 - 1e-6, pixel_count / 2, scale=2 * trace / pixel_count)
    for _ in range(2):
        keep = texture < variance * quantile
        selected, texture = selected[keep], texture[keep]
        variance = np.linalg.eigvalsh(np.cov(selected.T))[0]
    return math.sqrt(variance)


def noise_cases(random):
    cases = []
    for noise, texture in [(0.05, 0.0), (0.03, 0.3)]:
        y, x = np.mgrid[:64, :72]
        image = 0.5 + 0.2 * np.sin(0.07 * x) * np.cos(0.05 * y) + noise * random.normal(size=x.shape)
        image += texture * random.normal(size=x.shape) * (x < 9)
        codes = np.round(1000 * image)
        value = pixels(codes).astype(float)
        chen = noise_chen(value)
        values = {"noise_chen": chen, "noise_liu": noise_liu(value), "blind_snr": 20 * math.log10(value.mean() / chen)}
        cases.append({"width": 72, "height": 64, "output": codes.astype(int).ravel().tolist(), "values": values})
    return cases


# SSIMULACRA 2


def ssimulacra2_images(amplitude):
    """Returns a reference and an output as codes of 8 bits. The tests compute the same images."""
    y, x = np.mgrid[:256, :264]
    reference = (3 * x + 2 * y) % 256 // 2 + 64 * ((x // 16 + y // 24) % 2)
    hashed = 7919 * x + 104729 * y + 12345
    hashed = hashed * hashed // 7 % 1009
    output = np.clip(reference + hashed % (2 * amplitude + 1) - amplitude, 0, 255)
    return reference, output


def ssimulacra2_cases():
    """Returns the scores of a Python program.

    The program reflects images at two borders. After the replacement of `blur_image`, the outside is black at all borders,
    as in the crate. The crate approximates the Gaussian by a recursive filter.
    """
    import ssimulacra2.ssimulacra2 as program
    from PIL import Image

    def blur_image(image, sigma=1.5):
        return ndimage.gaussian_filter(image, sigma, truncate=10 / 3, mode="constant", axes=(0, 1))

    program.blur_image = blur_image
    cases = []
    with tempfile.TemporaryDirectory() as folder:
        paths = [f"{folder}/{name}.png" for name in ("reference", "output")]
        for amplitude in (2, 10, 40):
            for path, image in zip(paths, ssimulacra2_images(amplitude)):
                Image.fromarray(np.stack([image.astype(np.uint8)] * 3, axis=-1)).save(path)
            cases.append({"amplitude": amplitude, "value": float(program.compute_ssimulacra2(*paths))})
    return cases


# Flow


def read_flow(flow):
    """Writes a flow field as a Middlebury file and reads the file with OpenCV."""
    with tempfile.TemporaryDirectory() as folder:
        path = f"{folder}/a.flo"
        with open(path, "wb") as file:
            file.write(struct.pack("<fii", 202021.25, flow.shape[1], flow.shape[0]))
            file.write(flow.astype("<f4").tobytes())
        return cv2.readOpticalFlow(path).astype(float)


def flow_cases(random):
    cases = []
    for scale in (1, 30, 150):
        truth = np.round(1000 * scale * random.normal(size=(12, 17, 2)))
        output = np.round(truth + 2500 * random.normal(size=truth.shape))
        valid, occluded = random.random((12, 17)) < 0.9, random.random((12, 17)) < 0.2
        a, b = read_flow(pixels(output)), read_flow(pixels(truth))
        error = np.hypot(*(a - b).transpose(2, 0, 1))
        length = np.hypot(*b.transpose(2, 0, 1))
        is_outlier = (error > 3) & (error / length > 0.05)
        values = {}
        for suffix, mask in (("", valid & ~occluded), ("_occluded", valid & occluded)):
            values["flow_epe" + suffix] = float(error[mask].mean())
            values["flow_outliers" + suffix] = float(100 * is_outlier[mask].mean())
        cases.append(
            {
                "output": output.astype(int).ravel().tolist(),
                "truth": truth.astype(int).ravel().tolist(),
                "valid": valid.ravel().tolist(),
                "occluded": occluded.ravel().tolist(),
                "values": values,
            }
        )
    return cases


# Depth


def depth_cases(random):
    cases = []
    for spread in (0.05, 0.2, 0.6):
        truth = np.round(1000 * np.exp(random.uniform(1, 5, 200)))
        output = np.maximum(np.round(truth * np.exp(spread * random.normal(size=200))), 1)
        # A depth of 0 is the sky.
        truth[random.random(200) < 0.1] = 0
        known = truth > 0
        d, g = (pixels(codes[known]).astype(float) for codes in (output, truth))
        ratio = np.maximum(d / g, g / d)
        values = {
            "depth_abs_rel": float(np.mean(np.abs(d - g) / g)),
            "depth_rmse_log": float(np.sqrt(np.mean((np.log(d) - np.log(g)) ** 2))),
        }
        for k in (1, 2, 3):
            values[f"depth_delta_{k}"] = float((ratio < 1.25**k).mean())
        cases.append({"output": output.astype(int).tolist(), "truth": truth.astype(int).tolist(), "values": values})
    return cases


# Detection

COCO_KEYS = ["ap", "ap_50", "ap_75", "ap_small", "ap_medium", "ap_large"]
COCO_KEYS += ["ar_1", "ar_10", "ar_100", "ar_small", "ar_medium", "ar_large"]


def random_box(random, side):
    return np.round([*random.uniform(0, 400, 2), *(side * random.uniform(0.5, 1.5, 2))], 2).tolist()


def detection_images(random, count, classes, is_dense):
    images = []
    for _ in range(count):
        truth, detections = [], []
        for _ in range(random.integers(0, 7)):
            box = random_box(random, random.choice([15, 60, 160]))
            label, area = int(random.integers(classes)), round(float(box[2] * box[3] * random.uniform(0.5, 1)), 2)
            truth.append({"class": label, "box": box, "area": area, "is_crowd": bool(random.random() < 0.15)})
            for _ in range(random.integers(0, 4)):
                shift = random.normal(size=4) * random.choice([0.03, 0.1, 0.3]) * np.array(box)[[2, 3, 2, 3]]
                moved = np.round(np.array(box) + shift, 2)
                moved[2:] = np.abs(moved[2:]) + 1
                label = label if random.random() < 0.9 else int(random.integers(classes))
                # Scores of two digits contain ties.
                score = round(float(random.random()), 2)
                detections.append({"class": label, "box": moved.tolist(), "score": score})
        for _ in range(130 if is_dense else random.integers(0, 4)):
            box = random_box(random, random.choice([15, 60, 160]))
            score = round(float(random.random()), 2)
            detections.append({"class": int(random.integers(classes)), "box": box, "score": score})
        images.append({"truth": truth, "detections": detections})
    return images


def coco_scores(images, classes):
    from pycocotools.coco import COCO
    from pycocotools.cocoeval import COCOeval

    annotations, results = [], []
    for i, image in enumerate(images):
        for o in image["truth"]:
            entry = {"id": len(annotations) + 1, "image_id": i, "category_id": o["class"], "bbox": o["box"]}
            annotations.append({**entry, "area": o["area"], "iscrowd": int(o["is_crowd"])})
        for d in image["detections"]:
            results.append({"image_id": i, "category_id": d["class"], "bbox": d["box"], "score": d["score"]})
    with contextlib.redirect_stdout(io.StringIO()):
        coco = COCO()
        coco.dataset = {
            "info": {},
            "images": [{"id": i} for i in range(len(images))],
            "annotations": annotations,
            "categories": [{"id": k} for k in range(classes)],
        }
        coco.createIndex()
        evaluation = COCOeval(coco, coco.loadRes(results), "bbox")
        evaluation.evaluate()
        evaluation.accumulate()
        evaluation.summarize()
    # The value -1 means that there is no object.
    return {key: None if x == -1 else float(x) for key, x in zip(COCO_KEYS, evaluation.stats)}


def detection_cases(random):
    cases = []
    for count, classes, is_dense in [(1, 1, False), (12, 3, False), (20, 2, False), (4, 1, True)]:
        images = detection_images(random, count, classes, is_dense)
        while not any(image["detections"] for image in images):
            images = detection_images(random, count, classes, is_dense)
        cases.append({"images": images, "values": coco_scores(images, classes)})
    return cases


# Tracking

TRACKING_KEYS = {"hota": "HOTA", "det_a": "DetA", "ass_a": "AssA", "loc_a": "LocA"}


def tracking_frames(random, count, objects, noise):
    start, speed = random.uniform(0, 200, (objects, 2)), random.normal(size=(objects, 2)) * 4
    size = random.uniform(20, 60, (objects, 2))
    numbers = random.permutation(100)[:objects]
    frames = []
    for t in range(count):
        truth, output = [], []
        for k in range(objects):
            box = np.round([*(start[k] + t * speed[k]), *size[k]], 2)
            if random.random() < 0.9:
                truth.append({"track": k, "box": box.tolist()})
            if random.random() < 0.85:
                moved = np.round(box + noise * random.normal(size=4), 2)
                moved[2:] = np.abs(moved[2:]) + 1
                output.append({"track": int(numbers[k]), "box": moved.tolist()})
            if random.random() < 0.03:
                numbers[k] = 100 * (t + 1) + k
        if random.random() < 0.3:
            box = np.round([*random.uniform(0, 200, 2), 30, 30], 2).tolist()
            output.append({"track": 100000 + t, "box": box})
        frames.append({"truth": truth, "output": output})
    return frames


def hota_result(frames):
    from trackeval.datasets._base_dataset import _BaseDataset
    from trackeval.metrics import HOTA

    def boxes(entries):
        return np.array([e["box"] for e in entries], float).reshape(-1, 4)

    data = {"similarity_scores": []}
    for key in ("truth", "output"):
        numbers = sorted({e["track"] for frame in frames for e in frame[key]})
        ids = [np.array([numbers.index(e["track"]) for e in frame[key]], int) for frame in frames]
        name = {"truth": "gt", "output": "tracker"}[key]
        data |= {f"{name}_ids": ids, f"num_{name}_ids": len(numbers), f"num_{name}_dets": sum(map(len, ids))}
    for frame in frames:
        iou = _BaseDataset._calculate_box_ious(boxes(frame["truth"]), boxes(frame["output"]))
        data["similarity_scores"].append(iou)
    return HOTA().eval_sequence(data)


def hota_scores(result):
    values = {key: float(np.mean(result[name])) for key, name in TRACKING_KEYS.items()}
    by_threshold = {key: np.asarray(result[name], float).tolist() for key, name in TRACKING_KEYS.items()}
    return {"values": values, "by_threshold": by_threshold}


def tracking_cases(random):
    from trackeval.metrics import HOTA

    sequences = []
    for count, objects, noise in [(20, 4, 2.0), (15, 9, 6.0), (6, 1, 0.5)]:
        sequences.append(tracking_frames(random, count, objects, noise))
    sequences.append([{"truth": frame["truth"], "output": []} for frame in sequences[2]])
    results = [hota_result(frames) for frames in sequences]
    combined = HOTA().combine_sequences(dict(enumerate(results)))
    cases = [{"frames": frames, **hota_scores(result)} for frames, result in zip(sequences, results)]
    return cases, hota_scores(combined)


# Aggregation


class Pcg64Mcg:
    """The generator of the crate `rand_pcg`, seeded by `seed_from_u64` of `rand_core`."""

    def __init__(self, seed):
        words = []
        for _ in range(4):
            seed = (seed * 6364136223846793005 + 11634580027462260723) % 2**64
            x = (((seed >> 18) ^ seed) >> 27) % 2**32
            turn = seed >> 59
            words.append((x >> turn | x << (32 - turn) % 32) % 2**32)
        self.state = sum(word << 32 * k for k, word in enumerate(words)) | 1

    def next(self):
        self.state = self.state * 0x2360ED051FC65DA44385DF649FCCF645 % 2**128
        x = (self.state >> 64 ^ self.state) % 2**64
        turn = self.state >> 122
        return (x >> turn | x << (64 - turn) % 64) % 2**64


def bootstrap(n, seed, resamples, statistic):
    generator = Pcg64Mcg(seed)
    draws = [[generator.next() * n >> 64 for _ in range(n)] for _ in range(resamples)]
    low, high = np.percentile([statistic(chosen) for chosen in draws], [2.5, 97.5])
    return {"value": float(statistic(range(n))), "low": float(low), "high": float(high)}


def summary(sequences, seed, resamples):
    means = [np.mean(s) for s in sequences]
    n = len(means)
    return {
        "pooled": bootstrap(n, seed, resamples, lambda c: np.mean(np.concatenate([sequences[i] for i in c]))),
        "sequence_mean": bootstrap(n, seed, resamples, lambda c: np.mean([means[i] for i in c])),
    }


def aggregate_cases(random):
    cases = []
    for count, seed, resamples in [(2, 0, 40), (5, 1, 333), (17, 2**63 + 5, 200)]:
        lengths = random.integers(1, 9, count)
        a = [np.round(30 + 5 * random.normal() + random.normal(size=n), 3) for n in lengths]
        b = [np.round(s - 0.5 + 0.2 * random.normal(size=len(s)), 3) for s in a]
        content = {"a": [s.tolist() for s in a], "b": [s.tolist() for s in b], "seed": seed, "resamples": resamples}
        difference = summary([x - y for x, y in zip(a, b)], seed, resamples)
        cases.append({**content, "summary": summary(a, seed, resamples), "difference": difference})
    return cases


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--spikezoo", required=True)
    parser.add_argument("--spikecv", required=True)
    arguments = parser.parse_args()
    random = np.random.default_rng(2026)

    cases = image_cases(random, arguments)
    write("image", ["numpy", "scipy", "scikit-image", "opencv-python-headless"], cases[0]["values"], cases=cases)
    cases = noise_cases(random)
    write("noise", ["numpy", "scipy"], cases[0]["values"], cases=cases)
    write("ssimulacra2", ["numpy", "scipy", "ssimulacra2"], ["ssimulacra2"], cases=ssimulacra2_cases())
    cases = flow_cases(random)
    write("flow", ["numpy", "opencv-python-headless"], cases[0]["values"], cases=cases)
    cases = depth_cases(random)
    write("depth", ["numpy"], cases[0]["values"], cases=cases)
    write("detection", ["numpy", "pycocotools"], COCO_KEYS, cases=detection_cases(random))
    cases, combined = tracking_cases(random)
    write("tracking", ["numpy", "scipy", "trackeval"], TRACKING_KEYS, cases=cases, combined=combined)
    write("aggregate", ["numpy"], [], cases=aggregate_cases(random))
    cases = color_cases(np.random.default_rng(2027))
    write("color", ["numpy", "scikit-image"], cases[0]["values"], cases=cases)


if __name__ == "__main__":
    main()
