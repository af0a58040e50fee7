"""Writes hosek_wilkie.bin, the tables of the Hosek-Wilkie sky and its sun. model.rs describes the layout.

    python3 tables.py ArHosekSkyModelData_RGB.h ArHosekSkyModelData_Spectral.h ciexyz31_1.csv

The headers are those of version 1.4a of the authors' code. The CSV file contains the CIE 1931 color matching functions in steps of
1 nm, as cvrl.org has them: wavelength, x, y, z.

The sun's radiance is interpolated linearly between the wavelengths of the tables, and so is the mean of its limb darkening over the
disk. Their product is then integrated with the color matching functions.
"""

import re
import struct
import sys
from pathlib import Path

FIRST, STEP, COUNT = 320, 40, 11  # wavelengths of the spectral tables, in nm
TURBIDITIES, ALBEDOS, CONTROL_POINTS, SEGMENTS, ORDER = 10, 2, 6, 45, 4
QUADRATURE_STEP = 0.25  # nm
XYZ_TO_RGB = [
    [3.2409699419045226, -1.5373831775700939, -0.4986107602930034],
    [-0.9692436362808796, 1.8759675015077202, 0.0415550574071756],
    [0.0556300796969936, -0.2039769588889765, 1.0569715142428784],
]


def read_array(header, name):
    body = re.search(rf"\b{name}\[\]\s*=\s*{{(.*?)}};", header, re.S).group(1)
    return [float(number) for number in re.sub(r"//.*", "", body).replace(",", " ").split()]


def read_matching_functions(path):
    rows = [[float(cell) for cell in line.split(",")] for line in Path(path).read_text().split()]
    return {int(row[0]): row[1:] for row in rows}


def limb_mean(polynomial):
    """Mean over the disk of a polynomial in the cosine."""
    return sum(2 * factor / (power + 2) for power, factor in enumerate(polynomial))


def node_weights(matching, limb_means):
    """Returns the weight of each tabulated wavelength in the radiance of each channel."""
    luminance = sum(y for _, y, _ in matching.values())
    weights = [[0.0] * 3 for _ in range(COUNT)]
    last = FIRST + STEP * (COUNT - 1)
    steps = round((last - min(matching)) / QUADRATURE_STEP)
    for step in range(steps + 1):
        wavelength = last - step * QUADRATURE_STEP
        below = int(wavelength)
        fraction = wavelength - below
        xyz = [a + (b - a) * fraction for a, b in zip(matching[below], matching[below + 1])]
        node = min(int((wavelength - FIRST) / STEP), COUNT - 2)
        position = (wavelength - FIRST) / STEP - node
        limb = limb_means[node] * (1 - position) + limb_means[node + 1] * position
        length = QUADRATURE_STEP * (0.5 if step in (0, steps) else 1.0)
        for channel, row in enumerate(XYZ_TO_RGB):
            value = sum(a * b for a, b in zip(row, xyz)) * limb * length / luminance
            weights[node][channel] += value * (1 - position)
            weights[node + 1][channel] += value * position
    return weights, luminance


def main():
    rgb, spectral = (Path(path).read_text(errors="replace") for path in sys.argv[1:3])
    wavelengths = [FIRST + STEP * index for index in range(COUNT)]
    limb_means = []
    for nanometers in wavelengths:
        limb_means.append(limb_mean(read_array(spectral, f"limbDarkeningDataset{nanometers}")))
    weights, luminance = node_weights(read_matching_functions(sys.argv[3]), limb_means)

    table = []
    shapes = [read_array(rgb, f"datasetRGB{channel}") for channel in (1, 2, 3)]
    radiances = [read_array(rgb, f"datasetRGBRad{channel}") for channel in (1, 2, 3)]
    for turbidity in range(TURBIDITIES):
        for albedo in range(ALBEDOS):
            for control in range(CONTROL_POINTS):
                place = (albedo * TURBIDITIES + turbidity) * CONTROL_POINTS + control
                for shape, radiance in zip(shapes, radiances):
                    table += shape[9 * place : 9 * place + 9] + [radiance[place] / luminance]
    suns = [read_array(spectral, f"solarDataset{nanometers}") for nanometers in wavelengths]
    for segment in range(TURBIDITIES * SEGMENTS):
        for channel in range(3):
            # The published polynomials begin with the highest power.
            for power in reversed(range(ORDER)):
                table.append(sum(sun[segment * ORDER + power] * row[channel] for sun, row in zip(suns, weights)))
    Path(__file__).with_name("hosek_wilkie.bin").write_bytes(struct.pack(f"<{len(table)}f", *table))


main()
