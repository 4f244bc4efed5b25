// SPDX-License-Identifier: Apache-2.0
#include "tests/web/recorder.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>

#include "algo/base/units.hpp"
#include "algo/surface/surface_mesh.hpp"
#include "daemon/database/store_json.hpp"
#include "daemon/files/compact_map.hpp"
#include "daemon/files/scene_folder.hpp"
#include "daemon/result/result_folder.hpp"
#include "tests/support/result_with.hpp"

namespace plumb::test {

const Pose kT_iec_reference(Eigen::AngleAxisd(90 * kDegree, Eigen::Vector3d::UnitZ()));
namespace {

namespace fs = std::filesystem;

const Eigen::Vector3d kCentre(0.6, 0.45, 0.0);

CompareOptions Options() {
  CompareOptions options;
  options.T_iec_reference = kT_iec_reference;
  return options;
}

SyntheticOptions At(const Pose& T_motion, unsigned seed, double noise_m) {
  SyntheticOptions options;
  options.T_reference_body = T_motion * Pose(Eigen::Translation3d(kCentre));
  options.seed = seed;
  options.noise_m = noise_m;
  return options;
}

/// By a sensor that is known well: its numbers have digits behind the point.
Scene SceneOf(const SyntheticOptions& options) {
  Scene scene = MakeSyntheticScene(options);
  scene.sensitivity = KnownCalibration(scene);
  return scene;
}

Scene MeshedSceneOf(const SyntheticOptions& options) {
  Scene scene = SceneOf(options);
  if (scene.height_map) scene.mesh = MeshOfHeightMap(*scene.height_map, {}, {.decimation = 3});
  return scene;
}

}  // namespace

SyntheticOptions Sweep(int number) {
  if (number == 0) return At(Pose::Identity(), 1, 0.0);
  if (number == 1)
    return At(BodyMotionAbout(kCentre, {0.0062, -0.0124, 0.0041}, -2.4, 0.6, -0.5), 2, 0.0008);
  SyntheticOptions right = At(BodyMotionAbout(kCentre, {0.0006, -0.0004, 0.0003}, 0.05), 3, 0.0008);
  if (number == 2) return right;
  for (const auto& [id, marker] : MakeSyntheticScene(Sweep(0)).markers)
    right.hidden_markers.insert(id);
  right.hidden_markers.erase(right.hidden_markers.begin());
  return right;
}

SyntheticOptions Stranger() {
  SyntheticOptions stranger = At(Pose::Identity(), 4, 0.0008);
  stranger.shape = BodyShape::kTorsoWide;
  return stranger;
}

// x is to the head, y to the right of who lies on the back.
SyntheticOptions LiftedShoulder() {
  SyntheticOptions lifted = At(Pose::Identity(), 5, 0.0008);
  lifted.deform = [](const Eigen::Vector3d& p) {
    const double share =
        std::clamp((p.x() - 0.08) / 0.05, 0.0, 1.0) * std::clamp((-p.y() - 0.01) / 0.04, 0.0, 1.0);
    return Eigen::Vector3d(0, 0, 0.016 * share);
  };
  return lifted;
}

SyntheticOptions WithHole() {
  SyntheticOptions hole = At(Pose::Identity(), 7, 0.0008);
  hole.hidden = [](const Eigen::Vector3d& p) {
    return (p - kCentre).head<2>().cwiseAbs().maxCoeff() < 0.06;
  };
  return hole;
}

SyntheticOptions LyingRight(unsigned seed) { return At(Pose::Identity(), seed, 0.0008); }

FakeAppliance::Recorded Recorder::Record(const SyntheticOptions& options) {
  Scene scene = MeshedSceneOf(options);
  const fs::path folder = NewFolder();
  WriteScene(scene, folder / "scene");
  if (!reference_) {
    reference_ = std::move(scene);
    return {folder, std::nullopt};
  }
  return Write(folder, Compare(*reference_, scene, Options()));
}

FakeAppliance::Recorded Recorder::Once(const std::string& name,
                                       const std::function<SyntheticOptions()>& options) {
  const auto made = made_.find(name);
  return made != made_.end() ? made->second : made_.emplace(name, Record(options())).first->second;
}

FakeAppliance::Recorded Recorder::RecordChanged(const SyntheticOptions& options,
                                                const std::function<void(Scene&)>& change) {
  Scene scene = SceneOf(options);
  change(scene);
  const fs::path folder = NewFolder();
  WriteScene(scene, folder / "scene");
  return Write(folder, Compare(*reference_, scene, Options()));
}

FakeAppliance::Recorded Recorder::RecordWeak() {
  Comparison comparison = Still();
  comparison.motion->weak_directions = {{.name = "roll", .u95 = 0.9, .unit = "deg"}};
  return WriteOfFirst(comparison);
}

FakeAppliance::Recorded Recorder::RecordAcross() {
  const Scene scene = MeshedSceneOf(Sweep(1));
  CompareOptions across = Options();
  across.T_iec_reference = Pose::Identity();
  const fs::path folder = NewFolder();
  WriteScene(scene, folder / "scene");
  return Write(folder, Compare(*reference_, scene, across));
}

FakeAppliance::Recorded Recorder::RecordMotion(const std::string& axis, double amount,
                                               const std::string& posture, bool is_room_known) {
  const std::string names[] = {"x", "y", "z", "pitch", "roll", "yaw"};
  const auto which = std::find(std::begin(names), std::end(names), axis) - std::begin(names);
  PatientPosture lies = PatientPosture::kHeadFirstSupine;
  for (const PatientPosture known :
       {PatientPosture::kHeadFirstProne, PatientPosture::kFeetFirstSupine,
        PatientPosture::kFeetFirstProne}) {
    if (posture == Name(known)) lies = known;
  }
  const Eigen::Vector3d along = Eigen::Vector3d::Unit(which % 3);
  Comparison comparison = Still();
  const Eigen::Vector3d isocentre = kT_iec_reference * comparison.motion->centroid_m;
  const Pose T_room = which >= 3 ? Eigen::Translation3d(isocentre) *
                                       Pose(Eigen::AngleAxisd(amount * kDegree, along)) *
                                       Eigen::Translation3d(-isocentre)
                                 : Pose(Eigen::Translation3d(amount * kMillimetre * along));
  comparison.motion->T = kT_iec_reference.inverse() * T_room * kT_iec_reference;
  comparison.correction = CorrectionOf(
      comparison.motion->T, comparison.motion->covariance, comparison.motion->centroid_m,
      comparison.motion->centroid_m, is_room_known ? std::optional(kT_iec_reference) : std::nullopt,
      MarkerKind::kRoom, lies, comparison.body_parts->patient);
  if (!is_room_known) comparison.body_parts->room.reset();
  comparison.judgements = testing::JudgementsOf(Stored(comparison));
  std::array<bool, 6> all{};
  all.fill(true);
  comparison.verdict = VerdictOf(comparison.judgements, all);
  comparison.reasons = {Message::Verbatim("known motion")};
  return WriteOfFirst(comparison);
}

fs::path Recorder::NewFolder() {
  const fs::path folder = root_ / fmt::format("sweep_{}", num_folders_++);
  fs::create_directories(folder);
  return folder;
}

FakeAppliance::Recorded Recorder::Write(const fs::path& folder, const Comparison& comparison) {
  WriteResult(comparison, DrawResult(comparison, &*reference_->height_map), folder / "result");
  return {folder, SummaryOf(ResultText(Stored(comparison)))};
}

const Comparison& Recorder::Still() {
  if (!still_) still_ = Compare(*reference_, SceneOf(At(Pose::Identity(), 6, 0.0)), Options());
  return *still_;
}

FakeAppliance::Recorded Recorder::WriteOfFirst(const Comparison& comparison) {
  const fs::path folder = NewFolder();
  fs::create_directory_symlink(root_ / "sweep_0" / "scene", folder / "scene");
  return Write(folder, comparison);
}

std::string SurfaceAt(const Scene& scene, double share, bool has_region) {
  const HeightMap& seen = *scene.height_map;
  HeightMap shown({.x_min = -1.6, .y_min = -1.6, .step = 0.02, .width = 160, .height = 160});
  std::vector<std::uint8_t> missing(shown.z.size(), 0);
  for (int row = 0; row < seen.grid.height; ++row) {
    for (int column = 0; column < seen.grid.width; ++column) {
      const float z = seen.at(row, column);
      const auto cell = shown.grid.cell(seen.grid.x_centre(column), seen.grid.y_centre(row));
      if (std::isnan(z) || !cell) continue;
      if (column < share * seen.grid.width)
        shown.z[*cell] = z;
      else if (has_region && z > 0.03F)
        missing[*cell] = 1;
    }
  }
  return CompactHeights(shown, missing);
}

}  // namespace plumb::test
