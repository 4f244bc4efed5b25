// SPDX-License-Identifier: Apache-2.0
// The Python module `plumb`: recordings, scenes and comparisons as numpy arrays.
#include <pybind11/eigen.h>
#include <pybind11/functional.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "algo/base/errors.hpp"
#include "algo/base/units.hpp"
#include "algo/comparison/comparison.hpp"
#include "daemon/config/version.hpp"
#include "daemon/evaluation/evaluation.hpp"
#include "daemon/evaluation/report.hpp"
#include "daemon/files/scene_folder.hpp"
#include "daemon/pipeline/scan_runner.hpp"
#include "daemon/python/arrays.hpp"
#include "daemon/result/result_folder.hpp"
#include "drivers/replay/tum_recording.hpp"

namespace py = pybind11;
using namespace py::literals;

namespace plumb {
namespace {

Preset ParsePreset(const std::string& name) {
  if (const auto preset = Named<Preset>(name)) return *preset;
  throw py::value_error("preset: expected 'best' or 'paper', found '" + name + "'");
}

PatientPosture ParsePosture(const std::string& name) {
  if (const auto posture = Named<PatientPosture>(name)) return *posture;
  throw py::value_error("posture: expected 'HFS', 'HFP', 'FFS' or 'FFP', found '" + name + "'");
}

MarkerKind ParseMarkerKind(const std::string& name) {
  if (const auto kind = Named<MarkerKind>(name)) return *kind;
  throw py::value_error("marker_kind: expected 'room' or 'couch', found '" + name + "'");
}

Pose ParseRoomAxes(const Eigen::Matrix4d& matrix) {
  Pose T;
  T.matrix() = matrix;
  const bool is_rotation =
      (T.linear() * T.linear().transpose() - Eigen::Matrix3d::Identity()).norm() < 1e-4 &&
      T.linear().determinant() > 0;
  if (!is_rotation || matrix.row(3) != Eigen::RowVector4d(0, 0, 0, 1))
    throw py::value_error(
        "T_iec_reference: expected a rotation and a translation in metres, last row 0 0 0 1");
  return Orthonormalised(T);
}

using ProgressCall = std::function<void(const std::string& step, double fraction)>;

// Forwards progress to Python and turns Ctrl-C into a stop request.
std::function<void(double, std::string_view)> Forwarded(const ProgressCall& call,
                                                        std::stop_source& stop) {
  return [&call, &stop](double fraction, std::string_view step) {
    const py::gil_scoped_acquire held;
    if (PyErr_CheckSignals() != 0) {
      PyErr_Clear();
      stop.request_stop();
      return;
    }
    if (call) call(std::string(step), fraction);
  };
}

Scene Reconstruct(const std::filesystem::path& recording, const std::string& preset,
                  const ProgressCall& progress) {
  const std::unique_ptr<FrameSource> source = OpenTumRecording(recording);
  ScanRunnerOptions options;
  options.reconstructor.preset = ParsePreset(preset);
  std::stop_source stop;
  const auto forward = Forwarded(progress, stop);
  const py::gil_scoped_release released;
  return RunScan(*source, options, stop.get_token(),
                 [&](const ScanProgress& scan) { forward(scan.fraction, scan.step.English()); });
}

Comparison CompareScenes(const Scene& reference, const Scene& current, const std::string& preset,
                         const std::vector<Eigen::Vector2d>& region_m,
                         const std::optional<Eigen::Vector3d>& isocentre_m,
                         double shift_tolerance_mm, double rotation_tolerance_deg,
                         const std::string& posture, const std::string& marker_kind,
                         const std::optional<Eigen::Matrix4d>& T_iec_reference) {
  CompareOptions options;
  options.preset = ParsePreset(preset);
  options.region_polygon_m = region_m;
  options.isocentre_m = isocentre_m;
  options.limits.shift_tolerance_m = shift_tolerance_mm * kMillimetre;
  options.limits.rotation_tolerance_rad = rotation_tolerance_deg * kDegree;
  options.posture = ParsePosture(posture);
  options.marker_kind = ParseMarkerKind(marker_kind);
  if (T_iec_reference) options.T_iec_reference = ParseRoomAxes(*T_iec_reference);
  const py::gil_scoped_release released;
  return Compare(reference, current, options);
}

py::dict Numbers(const CouchNumbers& numbers) {
  return py::dict("vertical_mm"_a = numbers.vertical_mm,
                  "longitudinal_mm"_a = numbers.longitudinal_mm,
                  "lateral_mm"_a = numbers.lateral_mm, "pitch_deg"_a = numbers.pitch_deg,
                  "roll_deg"_a = numbers.roll_deg, "yaw_deg"_a = numbers.yaw_deg);
}

py::object Evaluate(const std::filesystem::path& folder, const std::string& preset,
                    const ProgressCall& progress) {
  const Suite suite = OpenSuite(folder);
  EvaluateOptions options;
  options.compare.preset = ParsePreset(preset);
  // Also asks for Ctrl-C during a reconstruction, which takes long.
  std::stop_source stop;
  const auto forward = Forwarded(progress, stop);
  options.get_scene = [&](const std::string& name) {
    const auto source = OpenTumRecording(suite.recordings.at(name));
    ScanRunnerOptions run;
    run.reconstructor.preset = options.compare.preset;
    return RunScan(*source, run, stop.get_token(),
                   [&](const ScanProgress& scan) { forward(scan.fraction, scan.step.English()); });
  };
  std::string json;
  {
    const py::gil_scoped_release released;
    const Evaluation evaluation = EvaluateSuite(
        suite, options, stop.get_token(),
        [&](const Message& step, double fraction) { forward(fraction, step.English()); });
    json = EvaluationJson(evaluation);
  }
  return py::module_::import("json").attr("loads")(json);
}

// Python iterator over a recording's frames.
class RecordingIterator {
 public:
  explicit RecordingIterator(const std::filesystem::path& folder)
      : source_(OpenTumRecording(folder)) {}
  Frame Next() {
    std::optional<Frame> frame;
    {
      const py::gil_scoped_release released;
      frame = source_->Next();
    }
    if (!frame) throw py::stop_iteration();
    return *frame;
  }
  [[nodiscard]] const StreamInfo& info() const { return source_->info(); }

 private:
  std::unique_ptr<FrameSource> source_;
};

void AddErrors(py::module_& module) {
  // Python programmers expect ValueError for bad input and OSError for a full disk.
  static py::exception<DataError> data_error(module, "DataError", PyExc_ValueError);
  static py::exception<IoError> io_error(module, "IoError", PyExc_OSError);
  py::register_exception_translator([](std::exception_ptr thrown) {
    try {
      if (thrown) std::rethrow_exception(thrown);
    } catch (const DataError& error) {
      data_error(error.what());
    } catch (const IoError& error) {
      io_error(error.what());
    } catch (const Interrupted&) {
      PyErr_SetNone(PyExc_KeyboardInterrupt);
    }
  });
}

void AddRecording(py::module_& module) {
  py::class_<Frame>(module, "Frame", "One colour image and the depth image that belongs to it.")
      .def_readonly("index", &Frame::index)
      .def_readonly("color_time_s", &Frame::color_time_s)
      .def_readonly("depth_time_s", &Frame::depth_time_s)
      .def_property_readonly(
          "color", [](const Frame& frame) { return ImageArray<std::uint8_t, 3>(frame.color_rgb); },
          "uint8 (height, width, 3), red, green, blue; shares the image's memory")
      .def_property_readonly(
          "depth_m", [](const Frame& frame) { return ImageArray<float, 1>(frame.depth_m); },
          "float32 (height, width), 0 where nothing was measured; shares the image's memory");
  py::class_<RecordingIterator>(module, "Recording", "The frames of a recording, in order.")
      .def(py::init<const std::filesystem::path&>(), "folder"_a)
      .def_property_readonly("camera_matrix",
                             [](const RecordingIterator& recording) {
                               const Intrinsics& k = recording.info().intrinsics;
                               Eigen::Matrix3d matrix;
                               matrix << k.fx, 0, k.cx, 0, k.fy, k.cy, 0, 0, 1;
                               return matrix;
                             })
      .def_property_readonly(
          "marker_length_m",
          [](const RecordingIterator& recording) { return recording.info().room_markers.length_m; })
      .def_property_readonly("warnings",
                             [](const RecordingIterator& recording) {
                               return EnglishTexts(recording.info().warnings);
                             })
      .def("__iter__", [](py::object self) { return self; })
      .def("__next__", &RecordingIterator::Next);
}

void AddScene(py::module_& module) {
  py::class_<Scene>(module, "Scene", "The result of one sweep. Lengths in metres, scene frame.")
      .def_static("load", &ReadScene, "folder"_a, "parts"_a = SceneParts{true, true, true},
                  py::call_guard<py::gil_scoped_release>())
      .def(
          "save",
          [](const Scene& scene, const std::filesystem::path& folder) {
            WriteScene(scene, folder);
          },
          "folder"_a, py::call_guard<py::gil_scoped_release>())
      .def_property_readonly("preset", [](const Scene& s) { return Name(s.preset); })
      .def_property_readonly("frame", [](const Scene& s) { return Name(s.frame); })
      .def_property_readonly(
          "markers",
          [](const Scene& s) {
            py::dict markers;
            for (const auto& [id, marker] : s.markers) markers[py::int_(id)] = CornerArray(marker);
            return markers;
          },
          "id -> float64 (4, 3), corners in detector order")
      .def_property_readonly(
          "marker_sigmas_m",
          [](const Scene& s) {
            py::dict sigmas;
            for (const auto& [id, marker] : s.markers) sigmas[py::int_(id)] = marker.sigma_m;
            return sigmas;
          },
          "id -> standard deviation of one corner coordinate")
      .def_property_readonly(
          "keyframe_poses", [](const Scene& s) { return PoseArray(s.keyframes); },
          "float64 (n, 4, 4), T_scene_camera")
      .def_property_readonly("keyframe_times_s",
                             [](const Scene& s) { return TimeArray(s.keyframes); })
      .def_property_readonly(
          "poses", [](const Scene& s) { return PoseArray(s.trajectory); },
          "float64 (n, 4, 4), T_scene_camera of every tracked frame")
      .def_property_readonly("times_s", [](const Scene& s) { return TimeArray(s.trajectory); })
      .def_readonly("frames_total", &Scene::frames_total)
      .def_readonly("frames_tracked", &Scene::frames_tracked)
      .def_property_readonly(
          "points",
          [](py::object self) { return VectorArray(self.cast<Scene&>().cloud.points, self); },
          "float32 (n, 3); shares the scene's memory")
      .def_property_readonly(
          "normals",
          [](py::object self) { return VectorArray(self.cast<Scene&>().cloud.normals, self); },
          "float32 (n, 3); shares the scene's memory")
      .def_property_readonly(
          "colors",
          [](py::object self) { return ColorArray(self.cast<Scene&>().cloud.colors, self); },
          "uint8 (n, 3) of the points, red, green, blue, or empty; shares the scene's memory")
      .def_property_readonly(
          "vertices",
          [](py::object self) { return VectorArray(self.cast<Scene&>().mesh.vertices, self); },
          "float32 (n, 3) of the mesh; shares the scene's memory")
      .def_property_readonly(
          "vertex_colors",
          [](py::object self) { return ColorArray(self.cast<Scene&>().mesh.colors, self); },
          "uint8 (n, 3) of the mesh's vertices, or empty; shares the scene's memory")
      .def_property_readonly(
          "triangles",
          [](py::object self) { return TriangleArray(self.cast<Scene&>().mesh, self); },
          "uint32 (n, 3); shares the scene's memory")
      .def_property_readonly(
          "heights", [](py::object self) { return MapArray(self.cast<Scene&>().height_map, self); },
          "float32 (rows, columns), NaN where nothing was measured, or None; shares the scene's "
          "memory")
      .def_property_readonly(
          "grid", [](const Scene& s) { return GridDict(s.height_map); },
          "x_min, y_min, step in metres; row 0 is y_min; None without a height map")
      .def_readonly("calibration", &Scene::calibration)
      .def_readonly("calibration_sigma", &Scene::calibration_sigma)
      .def_readonly("calibration_prior_sigma", &Scene::calibration_prior_sigma)
      .def_readonly("timings_s", &Scene::timings_s)
      .def_property_readonly("warnings",
                             [](const Scene& scene) { return EnglishTexts(scene.warnings); });
}

void AddComparison(py::module_& module) {
  py::class_<Comparison>(module, "Comparison", "Two scenes of one patient, compared.")
      .def_property_readonly("verdict", [](const Comparison& c) { return Name(c.verdict); })
      .def_property_readonly("reasons", [](const Comparison& c) { return EnglishTexts(c.reasons); })
      .def_property_readonly("warnings",
                             [](const Comparison& c) { return EnglishTexts(c.warnings); })
      .def_property_readonly(
          "T_reference_current",
          [](const Comparison& c) -> std::optional<Eigen::Matrix4d> {
            if (!c.alignment) return std::nullopt;
            return c.alignment->T_reference_current.matrix();
          },
          "float64 (4, 4), the marker alignment, or None")
      .def_property_readonly(
          "motion",
          [](const Comparison& c) -> std::optional<Eigen::Matrix4d> {
            if (!c.motion) return std::nullopt;
            return c.motion->T.matrix();
          },
          "float64 (4, 4), maps the reference body onto the current one, or None")
      .def_property_readonly(
          "covariance",
          [](const Comparison& c) -> std::optional<Matrix6d> {
            if (!c.motion) return std::nullopt;
            return c.motion->covariance;
          },
          "float64 (6, 6) of the motion: rotation vector, translation; or None")
      .def_property_readonly(
          "correction",
          [](const Comparison& c) -> py::object {
            if (!c.correction) return py::none();
            return Numbers(c.correction->value);
          },
          "The six numbers: what to apply, unless the verdict is no_answer; or None")
      .def_property_readonly(
          "u95",
          [](const Comparison& c) -> py::object {
            if (!c.correction) return py::none();
            return Numbers(c.correction->u95);
          },
          "Their 95 % half-widths, or None")
      .def_property_readonly(
          "deviation_m",
          [](py::object self) { return MapArray(self.cast<Comparison&>().deviation, self); },
          "float32 (rows, columns), current minus reference height, or None")
      .def_property_readonly(
          "distance_m",
          [](py::object self) { return MapArray(self.cast<Comparison&>().distance, self); },
          "float32 (rows, columns), nearest-surface distance, or None")
      .def_property_readonly(
          "deviation_after_m",
          [](py::object self) { return MapArray(self.cast<Comparison&>().deviation_after, self); },
          "float32 (rows, columns), as deviation_m after the correction, or None")
      .def_property_readonly(
          "deformation",
          [](py::object self) -> py::object {
            const auto& deformation = self.cast<Comparison&>().deformation;
            if (!deformation) return py::none();
            return py::dict("points_m"_a = VectorArray(deformation->points, self),
                            "shifts_m"_a = VectorArray(deformation->shifts_m, self));
          },
          "What remains after the rigid motion: float32 (n, 3) points of the reference surface and "
          "their displacements; or None")
      .def(
          "to_json", [](const Comparison& comparison) { return ResultText(Stored(comparison)); },
          "The text of result.json");
}

}  // namespace
}  // namespace plumb

PYBIND11_MODULE(plumb, module) {
  using namespace plumb;
  module.doc() = "Patient positioning from hand-held RGB-D sweeps. Research use only.";
  module.attr("__version__") = std::string(Version());
  AddErrors(module);
  py::class_<SceneParts>(module, "SceneParts", "Which large parts of a scene folder to read.")
      .def(py::init<bool, bool, bool>(), "cloud"_a = true, "height_map"_a = true, "mesh"_a = true);
  AddRecording(module);
  AddScene(module);
  AddComparison(module);
  module.def("reconstruct", &Reconstruct, "recording"_a, "preset"_a = "best",
             "progress"_a = ProgressCall(),
             "Reconstructs a recording in the TUM RGB-D layout. Releases the interpreter lock.");
  module.def("compare", &CompareScenes, "reference"_a, "current"_a, "preset"_a = "best",
             "region_m"_a = std::vector<Eigen::Vector2d>(), "isocentre_m"_a = std::nullopt,
             "shift_tolerance_mm"_a = kDefaultShiftTolerance_mm,
             "rotation_tolerance_deg"_a = kDefaultRotationTolerance_deg, "posture"_a = "HFS",
             "marker_kind"_a = "room", "T_iec_reference"_a = std::nullopt,
             "Compares a current scene with its reference, by the room's axes if they are given. "
             "Releases the interpreter lock.");
  module.def("evaluate", &Evaluate, "suite"_a, "preset"_a = "best", "progress"_a = ProgressCall(),
             "Reconstructs and compares a suite with truth; the figures as a dict.");
}
