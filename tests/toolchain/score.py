#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
# toolchain/score: a suite whose truth is plain, submissions whose errors are known, and such as
# must be refused.
import json
import math
import pathlib
import subprocess
import sys
import tempfile

import numpy

SCORE = pathlib.Path(__file__).resolve().parents[2] / "toolchain" / "score"
SCENES = ("a", "b", "c")
# The reference marker lies turned by 90 degrees about the vertical, 1 m from the world's origin.
T_WORLD_MARKER = numpy.array([[0, -1, 0, 1.0], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
# In the world the body of scene b lies 10 mm further along x, that of c is turned by 90 degrees.
T_WORLD_BODY = {
    "a": numpy.eye(4),
    "b": numpy.eye(4),
    "c": numpy.array([[0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]]),
}
T_WORLD_BODY["b"][0, 3] = 0.01
CENTROID = numpy.array([0.2, 0.1, 0.1])
SIDE_M = 0.3  # Of the body, a square plate at a height of 0.1 m; half of it was seen.
TIMES = numpy.arange(0, 8, 0.01)


def circle(times):
    angle = 2 * math.pi * times / 8
    return numpy.stack((numpy.cos(angle), numpy.sin(angle), 0 * angle), axis=1)


def tum(times, positions, quaternion=(0, 0, 0, 1)):
    return "# a path\n" + "".join(
        " ".join(f"{value:.9f}" for value in (time, *position, *quaternion)) + "\n"
        for time, position in zip(times, positions)
    )


def plate(pose):
    """Two strips of two triangles; frames saw the first one only."""
    half = SIDE_M / 2
    corners = [(x, y, 0.1) for y in (0, SIDE_M) for x in (0, half)]
    corners += [(x, y, 0.1) for y in (0, SIDE_M) for x in (half, SIDE_M)]
    seen = [10] * 4 + [0] * 4
    vertices = b"".join(
        numpy.array([*(pose[:3, :3] @ corner + pose[:3, 3]), n], "<f4").tobytes()
        for corner, n in zip(corners, seen)
    )
    faces = b"".join(
        b"\3" + numpy.array(face, "<i4").tobytes()
        for face in ((0, 1, 2), (1, 3, 2), (4, 5, 6), (5, 7, 6))
    )
    head = (
        "ply\nformat binary_little_endian 1.0\nelement vertex 8\n"
        "property float x\nproperty float y\nproperty float z\nproperty float seen\n"
        "element face 4\nproperty list uchar int vertex_indices\nend_header\n"
    )
    return head.encode() + vertices + faces


def make_suite(folder):
    for name in SCENES:
        truth = folder / "truth" / name
        truth.mkdir(parents=True)
        (truth / "groundtruth.txt").write_text(tum(TIMES, circle(TIMES)))
        motion = {
            "T_world_body": T_WORLD_BODY[name].tolist(),
            "T_world_reference_marker": T_WORLD_MARKER.tolist(),
            "centroid_body": CENTROID.tolist(),
        }
        (truth / "motion.json").write_text(json.dumps(motion))
        (truth / "body.ply").write_bytes(plate(T_WORLD_BODY[name]))
    pairs = [[a, b] for a in SCENES for b in SCENES if a != b]
    (folder / "suite.json").write_text(
        json.dumps({"name": "plain", "scenes": SCENES, "pairs": pairs})
    )


def true_motion(reference, current):
    back = numpy.linalg.inv
    in_world = T_WORLD_BODY[current] @ back(T_WORLD_BODY[reference])
    return back(T_WORLD_MARKER) @ in_world @ T_WORLD_MARKER


class Submission:
    def __init__(self, folder, **head):
        self.folder = folder
        folder.mkdir()
        self.write("submission.json", json.dumps({"format": 1, "method": "by hand", **head}))

    def write(self, name, content):
        path = self.folder / name
        path.parent.mkdir(exist_ok=True)
        (path.write_bytes if isinstance(content, bytes) else path.write_text)(content)
        return self

    def heights(self, scene, values, step_m=0.005):
        # The plate of scene a lies at x 0 to 0.3, y -1 to -0.7 in the frame of the marker.
        (self.folder / scene).mkdir(exist_ok=True)
        numpy.save(self.folder / scene / "heights.npy", values.astype("<f4"))
        grid = {"x_min_m": 0.0, "y_min_m": 0.7, "step_m": step_m}
        return self.write(f"{scene}/heights.json", json.dumps(grid))


def run(suite, *submissions):
    kept = suite / "figures.json"
    kept.unlink(missing_ok=True)
    done = subprocess.run(
        [SCORE, suite, *(s.folder for s in submissions), "--json", kept],
        capture_output=True,
        text=True,
    )
    return done, json.loads(kept.read_text())["submissions"] if kept.exists() else None


def figures(suite, submission):
    done, results = run(suite, submission)
    assert done.returncode == 0, done.stderr
    return results[0], done.stdout


def close(value, expected, tolerance):
    assert abs(value - expected) <= tolerance, f"{value} is not {expected}"


def check_trajectories(suite, folder):
    times = numpy.arange(0.005, 7.99, 0.5)  # Between the true poses.
    there = circle(times)
    elsewhere = there @ T_WORLD_MARKER[:3, :3].T + (5, 6, 7)
    quarter = (0, 0, math.sqrt(0.5), math.sqrt(0.5))
    one_deg = (math.sin(math.radians(0.5)), 0, 0, math.cos(math.radians(0.5)))
    found, _ = figures(
        suite,
        Submission(folder / "paths")
        .write("a/trajectory.txt", tum(times, elsewhere, quarter))
        .write("b/trajectory.txt", tum(times, 1.01 * there))
        .write("c/trajectory.txt", tum(times[:9], there[:9], one_deg)),
    )
    errors = [found["scenes"][name]["trajectory"] for name in SCENES]
    # Moved rigidly: the chord of 10 ms of a circle of 1 m lies 0.008 mm inside of it.
    close(errors[0]["ate_rmse_mm"], 0, 0.01)
    close(errors[0]["rotation_rmse_deg"], 0, 1e-6)
    close(errors[0]["covered"], 1, 0.01)
    # A circle of 1 m that is 1 % too large is 10 mm off everywhere, whatever the rigid fit.
    close(errors[1]["ate_rmse_mm"], 10, 0.02)
    close(errors[1]["max_mm"], 10, 0.02)
    # Nine poses of sixteen, turned by one degree.
    close(errors[2]["rotation_rmse_deg"], 1, 1e-6)
    close(errors[2]["covered"], 4.5 / 8, 0.01)
    close(found["total"]["ate_rmse_mm"]["max"], 10, 0.02)
    two = Submission(folder / "two").write("a/trajectory.txt", tum(times[:2], there[:2]))
    assert figures(suite, two)[0]["scenes"]["a"]["trajectory"] is None


def check_surfaces(suite, folder):
    # In the frame of the marker, turned by 90 degrees and 1 m away, scene a's plate has x from 0
    # to 0.3 and y from 0.7 to 1; the half that was seen has y from 0.85.
    rows = 60
    two_up = numpy.full((rows, 60), 0.102)
    half = two_up.copy()
    half[:, :30] = numpy.nan
    found, _ = figures(
        suite, Submission(folder / "maps").heights("a", two_up).heights("b", half, 0.005)
    )
    a = found["scenes"]["a"]["surface"]
    for key, expected in (("bias_mm", 2), ("median_abs_mm", 2), ("p95_abs_mm", 2), ("rmse_mm", 2)):
        close(a[key], expected, 1e-3)
    close(a["completeness"], 1, 0.02)
    assert a["cells"] == 30 * 60, a
    b = found["scenes"]["b"]["surface"]
    close(b["completeness"], 0.5, 0.04)
    assert found["scenes"]["c"]["surface"] is None

    # A cloud 3 mm below, with a floor below that and stray points outside of the body.
    x, y = numpy.meshgrid(numpy.arange(0, 0.3, 0.001), numpy.arange(0.7, 1, 0.001))
    points = numpy.stack((x.ravel(), y.ravel(), numpy.full(x.size, 0.097)), axis=1)
    floor = points * (1, 1, 0)
    away = numpy.array([[-5.0, 0, 0], [9, 9, 9]])
    cloud = numpy.concatenate((points, floor, away))
    head = (
        "ply\nformat {} 1.0\ncomment a cloud\nelement vertex {}\nproperty double x\n"
        "property double y\nproperty double z\nend_header\n"
    )
    binary = head.format("binary_little_endian", len(cloud)).encode() + cloud.tobytes()
    text = head.format("ascii", len(cloud)) + "".join(
        "{:.6f} {:.6f} {:.6f}\n".format(*point) for point in cloud
    )
    for name, content in (("binary", binary), ("text", text)):
        found, _ = figures(suite, Submission(folder / name).write("a/cloud.ply", content))
        a = found["scenes"]["a"]["surface"]
        close(a["bias_mm"], -3, 1e-3)
        close(a["p95_abs_mm"], 3, 1e-3)
        close(a["completeness"], 1, 0.02)


def about_centroid(reference, degrees, shift_m):
    """A true motion with an error of its own: a turn about the centroid where it ends."""
    motion = true_motion("a", "b")
    centroid = numpy.linalg.inv(T_WORLD_MARKER) @ T_WORLD_BODY[reference] @ (*CENTROID, 1)
    point = (motion @ centroid)[:3]
    angle = math.radians(degrees)
    turn = numpy.eye(4)
    turn[:2, :2] = [[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]]
    turn[:3, 3] = point - turn[:3, :3] @ point + shift_m
    return turn @ motion


def check_motions(suite, folder):
    motions = [
        {"reference": "a", "current": "b", "motion": about_centroid("a", 0.6, (0, 0, 0)).tolist()},
        {"reference": "b", "current": "a", "motion": true_motion("b", "a").tolist()},
        {"reference": "a", "current": "c", "motion": true_motion("a", "c").tolist()},
        {"reference": "c", "current": "b"},
    ]
    wrong = true_motion("c", "a")
    wrong[:3, 3] += (0, 0.003, 0.004)
    motions.append({"reference": "c", "current": "a", "motion": wrong.tolist()})
    sent = Submission(folder / "motions", cpu_s=12.4, machine="a desk")
    found, printed = figures(suite, sent.write("motions.json", json.dumps(motions)))
    pairs = {(pair["reference"], pair["current"]): pair for pair in found["pairs"]}
    close(pairs["a", "b"]["translation_mm"], 0, 1e-6)
    close(pairs["a", "b"]["rotation_deg"], 0.6, 1e-6)
    for pair in (("b", "a"), ("a", "c")):
        close(pairs[pair]["translation_mm"], 0, 1e-6)
        close(pairs[pair]["rotation_deg"], 0, 1e-6)
    close(pairs["c", "a"]["translation_mm"], 5, 1e-6)
    total = found["total"]
    # One pair says that it has no answer, one is not there.
    assert total["pairs"] == 6 and total["no_answer"] == 2, total
    close(total["translation_mm"]["median"], 0, 1e-6)
    close(total["translation_mm"]["p95"], 0.85 * 5, 1e-6)
    close(total["translation_mm"]["max"], 5, 1e-6)
    assert "| 2 of 6 | 0.00, 4.25, 5.00 | 0.00, 0.51, 0.60 | — | 12 |" in printed, printed


def check_numbers(suite, folder):
    # The body of b lies 10 mm along the world's x, which is -y of the marker's frame; what restores
    # it is +10 mm along y, which is called longitudinal.
    columns = "reference,current,vertical_mm,longitudinal_mm,lateral_mm,pitch_deg,roll_deg,yaw_deg"
    columns += ",isocentre_x_m,isocentre_y_m,isocentre_z_m,u95_vertical_mm,u95_longitudinal_mm"
    columns += ",u95_lateral_mm,u95_pitch_deg,u95_roll_deg,u95_yaw_deg\n"
    # Intervals hold if the truth is within them, their ends included.
    table = columns
    table += "a,b,0.5,10,0,0,0,0, 0.1,0.8,0.1, 0.5,1,1,1,1,1\n"
    table += "b,a,0.5,-10,0,0,0,0, 0.1,0.8,0.1, 0.4,1,1,1,1,1\n"
    # The body of c is turned by +90 degrees about the vertical through the world's origin, the
    # point (0, 1, 0) of the marker's frame.
    table += "a,c,0,0,0,0,0,-90, 0,1,0, 1,1,1,1,1,1\n"
    table += "b,c" + 15 * "," + "\n"
    found, printed = figures(suite, Submission(folder / "table").write("motions.csv", table))
    pairs = {(pair["reference"], pair["current"]): pair for pair in found["pairs"]}
    for pair, off_mm in ((("a", "b"), 0.5), (("b", "a"), 0.5), (("a", "c"), 0)):
        close(pairs[pair]["translation_mm"], off_mm, 1e-6)
        close(pairs[pair]["rotation_deg"], 0, 1e-6)
    assert pairs["a", "b"]["holds"] == 6 * [True]
    assert pairs["b", "a"]["holds"] == [False] + 5 * [True]
    assert found["total"]["intervals"] == {"count": 18, "hold": 17}
    assert found["total"]["no_answer"] == 3
    assert "| 94.4 % of 18 |" in printed, printed
    # All three angles at once, as the documentation composes them.
    angles = numpy.radians((10, 20, 30))
    (cp, cr, cy), (sp, sr, sy) = numpy.cos(angles), numpy.sin(angles)
    turn = numpy.array(
        [
            [cy * cr - sy * sp * sr, -sy * cp, cy * sr + sy * sp * cr],
            [sy * cr + cy * sp * sr, cy * cp, sy * sr - cy * sp * cr],
            [-cp * sr, sp, cp * cr],
        ]
    )
    correction = numpy.eye(4)
    correction[:3, :3] = turn
    as_matrix = [{"reference": "a", "current": "b", "motion": numpy.linalg.inv(correction).tolist()}]
    as_numbers = columns + "a,b,0,0,0,10,20,30,0,0,0,,,,,,\n"
    one, _ = figures(
        suite, Submission(folder / "one").write("motions.json", json.dumps(as_matrix))
    )
    two, _ = figures(suite, Submission(folder / "other").write("motions.csv", as_numbers))
    for key in ("translation_mm", "rotation_deg"):
        assert one["pairs"][0][key] > 1
        close(one["pairs"][0][key], two["pairs"][0][key], 1e-9)


def check_refusals(suite, folder):
    identity = numpy.eye(4).tolist()
    mirrored = numpy.diag((1, 1, -1, 1)).tolist()

    def pairs(*rows):
        return json.dumps([{"reference": "a", "current": "b", **row} for row in rows])

    class Bad:
        def __reduce__(self):
            return (print, ("loaded",))

    many = numpy.array([[Bad()]], dtype=object)
    cases = (
        ("a/trajectory.txt", "0 1 2 3 0 0 0\n", ":1: expected 'time tx ty tz qx qy qz qw'"),
        ("a/trajectory.txt", "0 1 2 nan 0 0 0 1\n", ":1: expected"),
        ("a/trajectory.txt", "1 1 2 3 0 0 0 1\n1 1 2 3 0 0 0 1\n", ":2: times must rise"),
        ("a/trajectory.txt", "0 1 2 3 0 0 0 2\n", "quaternion's length"),
        ("a/trajectory.txt", "# nothing\n", "has no poses"),
        ("a/path.txt", "", "unknown; a scene's folder has"),
        ("d/trajectory.txt", "", "the suite has no scene of this name"),
        ("poses.csv", "", "unknown; a submission has"),
        ("motions.json", pairs({"motion": identity}, {}), "is there twice"),
        ("motions.json", pairs({"current": "d"}), "the suite has no pair a -> d"),
        ("motions.json", pairs({"motion": mirrored}), "are no rotation"),
        ("motions.json", pairs({"motion": [[1, 2], [3, 4]]}), "expected 4x4 finite numbers"),
        ("motions.json", pairs({"movement": identity}), "expected an object with keys of"),
        ("motions.json", '[{"reference": NaN}]', "'NaN' is not JSON"),
        ("motions.json", pairs({"motion": identity, "u95_yaw_deg": 1}), "expected all of u95"),
        ("motions.csv", "reference,current,pitch\n", "unknown or repeated column 'pitch'"),
        ("motions.csv", "reference,current,pitch_deg\na,b,1\n", "expected all of vertical_mm"),
        ("motions.csv", "reference,current\na\n", "another number of cells than columns"),
        ("a/heights.npy", b"nothing", "cannot be read"),
        ("a/cloud.ply", b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\n"
         b"property float y\nproperty float z\nend_header\n1 2\n", "has 3 numbers"),
        ("a/cloud.ply", b"ply\nformat binary_little_endian 1.0\nelement vertex 9\n"
         b"property float x\nproperty float y\nproperty float z\nend_header\n1",
         "ends before the last vertex"),
        ("submission.json", '{"format": 2}', '"format": 1'),
        ("submission.json", '{"format": 1}', "name of the method"),
        ("submission.json", '{"format": 1, "method": "m", "cpu_s": 3}', "beside 'machine'"),
        ("submission.json", '{"format": 1, "method": "m", "rank": 1}', "unknown key 'rank'"),
    )  # fmt: skip
    for number, (name, content, says) in enumerate(cases):
        done, found = run(suite, Submission(folder / f"bad-{number}").write(name, content))
        assert done.returncode == 3, f"{name}: {done.returncode} {done.stderr}"
        assert says in done.stderr and "Traceback" not in done.stderr, done.stderr
        assert done.stdout == "" and found is None
    # Objects of Python in an array would be a program; they are not loaded.
    pickled = Submission(folder / "pickled").heights("a", numpy.zeros((2, 2)))
    numpy.save(pickled.folder / "a" / "heights.npy", many, allow_pickle=True)
    done, _ = run(suite, pickled)
    assert done.returncode == 3 and "loaded" not in done.stdout, done.stdout
    # All faults at once; a good submission beside a bad one has no row either.
    two = Submission(folder / "several").write("a/x", "").write("b/trajectory.txt", "0\n")
    done, _ = run(suite, Submission(folder / "good"), two)
    assert done.returncode == 3 and "a/x" in done.stderr and "b/trajectory" in done.stderr


def main():
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        make_suite(folder / "suite")
        for check in (check_trajectories, check_surfaces, check_motions, check_numbers,
                      check_refusals):  # fmt: skip
            check(folder / "suite", folder)


if __name__ == "__main__":
    sys.exit(main())
