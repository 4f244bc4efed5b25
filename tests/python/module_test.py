#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The Python module on a small simulated suite: arrays, errors, types (plumb.pyi), the example.

Usage: module_test.py PLUMB_BINARY EXAMPLE FOLDER, with the module's folder in PYTHONPATH.
"""
import _thread
import ast
import contextlib
import importlib.util
import inspect
import io
import json
import pathlib
import re
import shutil
import subprocess
import sys
import threading
import time
import unittest

import numpy as np

import plumb

BINARY, EXAMPLE, FOLDER = sys.argv[1:4]
SUITE = pathlib.Path(FOLDER) / "suite"


def setUpModule():
    shutil.rmtree(FOLDER, ignore_errors=True)
    pathlib.Path(FOLDER).mkdir(parents=True)
    subprocess.run(
        [BINARY, "simulate", "--suite", "demo", "--frames", "60", "--size", "320x240", "--noise",
         "ideal", "--out", str(SUITE)],
        check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def truth(scene, name):
    return np.array(json.loads((SUITE / "truth" / scene / "motion.json").read_text())[name])


class RecordingTest(unittest.TestCase):
    def test_frames_are_arrays_that_share_memory(self):
        recording = plumb.Recording(SUITE / "recordings" / "reference")
        frames = list(recording)
        self.assertEqual(len(frames), 60)
        color, depth = frames[0].color, frames[0].depth_m
        self.assertEqual((color.shape, color.dtype), ((240, 320, 3), np.uint8))
        self.assertEqual((depth.shape, depth.dtype), ((240, 320), np.float32))
        self.assertTrue(np.shares_memory(color, frames[0].color))
        self.assertFalse(color.flags.writeable)
        self.assertTrue(0.3 < np.median(depth[depth > 0]) < 3.0)
        self.assertEqual(recording.camera_matrix.shape, (3, 3))

    def test_an_array_outlives_its_frame(self):
        color = next(plumb.Recording(SUITE / "recordings" / "reference")).color
        self.assertGreater(int(color.sum()), 0)

    def test_bad_input_is_a_value_error_with_the_reason(self):
        with self.assertRaisesRegex(plumb.DataError, "nothing_here"):
            plumb.Recording(pathlib.Path(FOLDER) / "nothing_here")
        self.assertTrue(issubclass(plumb.DataError, ValueError))
        with self.assertRaisesRegex(ValueError, "'best' or 'paper'"):
            plumb.reconstruct(SUITE / "recordings" / "reference", preset="fast")


class SceneTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.steps = set()
        cls.scenes = [
            plumb.reconstruct(SUITE / "recordings" / name,
                              progress=lambda step, fraction: cls.steps.add(step))
            for name in ("reference", "moved")
        ]

    def test_a_scene_has_poses_surface_and_heights(self):
        scene = self.scenes[0]
        self.assertEqual(scene.frame, "reference_marker")
        self.assertEqual(scene.poses.shape, (scene.frames_tracked, 4, 4))
        rotations = scene.poses[:, :3, :3]
        identity = rotations @ rotations.transpose(0, 2, 1)
        self.assertLess(np.abs(identity - np.eye(3)).max(), 1e-9)
        self.assertEqual(scene.points.shape, scene.normals.shape)
        self.assertTrue(np.shares_memory(scene.points, scene.points))
        self.assertEqual((scene.colors.shape, scene.colors.dtype), (scene.points.shape, np.uint8))
        self.assertEqual(scene.vertex_colors.shape, scene.vertices.shape)
        self.assertEqual(set(scene.marker_sigmas_m), set(scene.markers))
        self.assertTrue(all(0.0 < sigma < 0.01 for sigma in scene.marker_sigmas_m.values()))
        self.assertEqual(scene.heights.ndim, 2)
        self.assertAlmostEqual(scene.grid["step"], 0.0015)
        self.assertIn("tracking", self.steps)

    def test_a_scene_is_the_same_after_saving_and_loading(self):
        folder = pathlib.Path(FOLDER) / "scene"
        self.scenes[0].save(folder)
        loaded = plumb.Scene.load(folder)
        np.testing.assert_array_equal(loaded.triangles, self.scenes[0].triangles)
        np.testing.assert_array_equal(loaded.heights, self.scenes[0].heights)
        # Trajectories are text: rounded in the ninth decimal.
        np.testing.assert_allclose(loaded.keyframe_poses, self.scenes[0].keyframe_poses,
                                   atol=1e-8)

    def test_other_threads_run_while_a_scene_is_loaded(self):
        folder = pathlib.Path(FOLDER) / "loaded"
        self.scenes[0].save(folder)
        turns = 0
        ended = threading.Event()

        def count():
            nonlocal turns
            while not ended.is_set():
                turns += 1
                time.sleep(1e-4)

        # Threads then change only where one of them gives up the lock of its own accord.
        interval = sys.getswitchinterval()
        sys.setswitchinterval(60.0)
        other = threading.Thread(target=count)
        other.start()
        try:
            before = turns
            plumb.Scene.load(folder)
            after = turns
        finally:
            ended.set()
            other.join()
            sys.setswitchinterval(interval)
        self.assertGreater(after, before)

    def test_the_motion_is_the_one_that_was_simulated(self):
        result = plumb.compare(*self.scenes)
        moved = truth("moved", "T_world_body")
        start = truth("reference", "T_world_body")
        T_world_marker = truth("reference", "T_world_reference_marker")
        expected = np.linalg.inv(T_world_marker) @ moved @ np.linalg.inv(start) @ T_world_marker
        centre = np.append(np.linalg.inv(T_world_marker)[:3, :3] @ start[:3, 3]
                           + np.linalg.inv(T_world_marker)[:3, 3], 1.0)
        miss_mm = 1000 * np.linalg.norm(((result.motion - expected) @ centre)[:3])
        self.assertLess(miss_mm, 1.5)  # measured: 1.24 mm at 320 columns
        self.assertEqual(result.covariance.shape, (6, 6))
        self.assertEqual(json.loads(result.to_json())["verdict"], result.verdict)
        self.assertEqual(result.deviation_after_m.shape, result.deviation_m.shape)
        self.assertLess(np.nanmedian(np.abs(result.deviation_after_m)),
                        np.nanmedian(np.abs(result.deviation_m)))
        remaining = result.deformation
        self.assertEqual(remaining["points_m"].shape, remaining["shifts_m"].shape)
        self.assertEqual(remaining["points_m"].shape[1], 3)

    def test_a_comparison_takes_the_rooms_axes_the_posture_and_the_kind_of_markers(self):
        plain = plumb.compare(*self.scenes)
        # The room's x axis is the marker's y axis: pitch is about x, roll about y.
        turned = np.array([[0.0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
        room = plumb.compare(*self.scenes, T_iec_reference=turned)
        self.assertAlmostEqual(room.correction["vertical_mm"], plain.correction["vertical_mm"])
        self.assertAlmostEqual(abs(room.correction["lateral_mm"]),
                               abs(plain.correction["longitudinal_mm"]))
        couch = plumb.compare(*self.scenes, marker_kind="couch")
        self.assertIsNone(couch.correction["vertical_mm"])
        bodies = [json.loads(plumb.compare(*self.scenes, T_iec_reference=turned,
                                           posture=posture).to_json())["body"]
                  for posture in ("HFS", "HFP")]
        np.testing.assert_allclose(bodies[0]["left_xy"], np.negative(bodies[1]["left_xy"]))
        for wrong in ({"posture": "up"}, {"marker_kind": "floor"},
                      {"T_iec_reference": np.diag([2.0, 1, 1, 1])}):
            with self.assertRaisesRegex(ValueError, next(iter(wrong))):
                plumb.compare(*self.scenes, **wrong)

    def test_ctrl_c_ends_an_evaluation_during_its_first_reconstruction(self):
        steps = []

        def interrupt(step, fraction):
            if not steps:
                threading.Timer(0.05, _thread.interrupt_main).start()
            steps.append(step)

        with self.assertRaises(KeyboardInterrupt):
            plumb.evaluate(SUITE, progress=interrupt)
        self.assertNotIn("comparing", steps)

    def test_a_comparison_with_a_region_that_holds_nothing_has_no_answer(self):
        far = [[9.0, 9.0], [9.1, 9.0], [9.1, 9.1]]
        self.assertEqual(plumb.compare(*self.scenes, region_m=far).verdict, "no_answer")


def parameters(function):
    """The parameters of a parsed function, and the defaults of those that have one."""
    names = [argument.arg for argument in function.args.args if argument.arg != "self"]
    defaults = function.args.defaults
    return names, dict(zip(names[len(names) - len(defaults):], map(ast.literal_eval, defaults)))


class TypesTest(unittest.TestCase):
    """Editors and mypy read plumb.pyi only: it must state what the module has."""

    def check_function(self, typed, real):
        # pybind11 writes the signature as the first line of the docstring. A default without
        # a literal is shown as <...> there, and as ... in the types.
        line = re.sub(r"<[^>]*>", "...", inspect.getdoc(real).splitlines()[0])
        names, defaults = parameters(ast.parse(f"def {line}: ...").body[0])
        typed_names, typed_defaults = parameters(typed)
        self.assertEqual(typed_names, names[-len(typed_names):] if typed_names else [], line)
        # An empty list is an empty tuple in the types, whose defaults must not be mutable.
        plain = {name: () if value == [] else value for name, value in defaults.items()}
        self.assertEqual(typed_defaults, plain, line)

    def test_the_types_have_the_names_and_defaults_of_the_module(self):
        types = ast.parse(pathlib.Path(plumb.__file__).with_name("plumb.pyi").read_text())
        found = set()
        checked = 0
        for node in types.body:
            if isinstance(node, ast.FunctionDef):
                self.check_function(node, getattr(plumb, node.name))
                checked += 1
            if isinstance(node, ast.ClassDef):
                real = getattr(plumb, node.name)
                members = {m.name: m for m in node.body if isinstance(m, ast.FunctionDef)}
                names = set(members) | {m.target.id for m in node.body
                                        if isinstance(m, ast.AnnAssign)}
                for name in names:
                    self.assertTrue(hasattr(real, name), f"{node.name}.{name}")
                self.assertEqual({name for name in names if not name.startswith("_")},
                                 {name for name in vars(real) if not name.startswith("_")},
                                 node.name)
                for name, member in members.items():
                    if name in ("__iter__", "__next__") or "property" in map(
                            ast.unparse, member.decorator_list):
                        continue
                    self.check_function(member, getattr(real, name))
                    checked += 1
            if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
                found.add(node.name)
        self.assertEqual(found, {name for name in dir(plumb) if not name.startswith("_")})
        self.assertGreaterEqual(checked, 8)


class ExampleTest(unittest.TestCase):
    def test_its_summary_and_its_points_are_those_of_the_errors(self):
        spec = importlib.util.spec_from_file_location("accuracy_table", EXAMPLE)
        example = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(example)
        pairs = [("a", "b", 1.0, 0.1), ("b", "a", 4.0, 0.2), ("a", "c", 2.5, 0.6)]
        figures = {"pairs": [dict(zip(("reference", "current", "translation_mm", "rotation_deg"),
                                      pair)) for pair in pairs]
                   + [{"reference": "b", "current": "c", "translation_mm": None}]}
        errors = example.pair_errors(figures)
        self.assertEqual(errors, pairs)
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            example.print_table(errors, {"translation_mm": {"mean": 11.458, "median": 10.497},
                                         "rotation_deg": {"mean": 1.6, "median": 1.196}})
        rows = [re.split(r"\s{2,}|(?<=[\w]) (?=\d)", line.strip())
                for line in printed.getvalue().splitlines()[4:]]
        self.assertEqual(rows, [["mean", "2.50", "0.300"], ["median", "2.50", "0.200"],
                                ["maximum", "4.00", "0.600"],
                                ["the paper, mean", "11.46", "1.600"],
                                ["the paper, median", "10.50", "1.196"]])
        picture = pathlib.Path(FOLDER) / "points.svg"
        example.write_svg(errors, picture)
        # 320 units wide from 40: 1.0 of 4.4 mm, 0.1 of 0.66 deg, which grow to the right and up.
        self.assertEqual(re.findall(r'cx="([\d.]+)" cy="([\d.]+)"', picture.read_text())[0],
                         ("112.7", "311.5"))
    def test_the_example_prints_the_table_and_draws_it(self):
        picture = pathlib.Path(FOLDER) / "errors.svg"
        run = subprocess.run([sys.executable, EXAMPLE, str(SUITE), "--svg", str(picture)],
                             check=True, capture_output=True, text=True)
        table = {line.rsplit(None, 2)[0].strip(): line.split()[-2:]
                 for line in run.stdout.splitlines()[1:]}
        # The demo has one pair, which is every summary of itself.
        (pair,) = (values for name, values in table.items()
                   if name.split() == ["reference", "moved"])
        for name in ("mean", "median", "maximum"):
            self.assertEqual(table[name], pair)
        self.assertTrue(0.0 < float(pair[0]) < 1.5, pair)  # measured: 1.24 mm
        self.assertEqual(table["the paper, mean"], ["11.46", "1.600"])
        self.assertEqual(picture.read_text().count("<circle"), 1)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1], verbosity=2)
