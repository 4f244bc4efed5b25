#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The accuracy table of a suite, and a picture of it.

Usage: accuracy_table.py SUITE [--svg FILE]

SUITE is what `plumb simulate` writes. Prints the motion error of each ordered pair (at the body's
centroid), their summary and the paper's, and writes the errors as points of an SVG.
"""
import argparse

import numpy as np

import plumb


def pair_errors(figures):
    """Reference, current, millimetres and degrees of each pair that has a motion."""
    return [
        (pair["reference"], pair["current"], pair["translation_mm"], pair["rotation_deg"])
        for pair in figures["pairs"]
        if pair.get("translation_mm") is not None
    ]


def print_table(errors, paper):
    """`paper` is the published total, as the figures of plumb.evaluate() contain it."""
    print(f"{'reference':>16} {'current':>16} {'mm':>7} {'deg':>7}")
    for reference, current, shift_mm, rotation_deg in errors:
        print(f"{reference:>16} {current:>16} {shift_mm:7.2f} {rotation_deg:7.3f}")
    shifts = np.array([error[2] for error in errors])
    rotations = np.array([error[3] for error in errors])
    for name, value in (("mean", np.mean), ("median", np.median), ("maximum", np.max)):
        print(f"{name:>33} {value(shifts):7.2f} {value(rotations):7.3f}")
    for name in ("mean", "median"):
        shift_mm, rotation_deg = (paper[key][name] for key in ("translation_mm", "rotation_deg"))
        print(f"{'the paper, ' + name:>33} {shift_mm:7.2f} {rotation_deg:7.3f}")


def write_svg(errors, path, size=320, margin=40):
    largest = max(1.0, 1.1 * max(error[2] for error in errors))
    steepest = max(0.1, 1.1 * max(error[3] for error in errors))
    points = "".join(
        f'<circle cx="{margin + size * shift / largest:.1f}" '
        f'cy="{margin + size * (1 - turn / steepest):.1f}" r="3"/>'
        for _, _, shift, turn in errors
    )
    side = size + 2 * margin
    with open(path, "w", encoding="utf-8") as svg:
        svg.write(
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {side} {side}">'
            f'<path d="M{margin} {margin}v{size}h{size}" fill="none" stroke="#888"/>'
            f'<g fill="#06c">{points}</g><g font-family="sans-serif" font-size="11">'
            f'<text x="{margin}" y="{side - 12}">0 to {largest:.1f} mm</text>'
            f'<text x="4" y="{margin - 12}">0 to {steepest:.2f} deg</text></g></svg>\n'
        )


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("suite")
    parser.add_argument("--svg")
    options = parser.parse_args()
    figures = plumb.evaluate(options.suite)
    errors = pair_errors(figures)
    if not errors:
        raise SystemExit("no pair of this suite has a motion")
    print_table(errors, figures["paper"]["total"])
    if options.svg:
        write_svg(errors, options.svg)
        print(f"wrote {options.svg}")


if __name__ == "__main__":
    main()
