// SPDX-License-Identifier: Apache-2.0
#include "daemon/files/stored_scene.hpp"

#include "algo/base/bounded_json.hpp"
#include "algo/types/marker_dictionary.hpp"
#include "daemon/files/stored_fields.hpp"
#include "drivers/files/image_file.hpp"
#include "words/scene_file.hpp"

namespace plumb {
namespace stored {

constexpr int kSceneFormat = 1;
constexpr std::size_t kMaxMarkers = 4096;
constexpr Bounds kCount{0, 1e9}, kTime_s{0, 1e9}, kCoordinate_m{-1e4, 1e4};

template <>
struct StoredFields<Breathing> {
  static void Fields(auto& self, const auto& visit) {
    constexpr Bounds kHeight_m{0, 1};
    visit("amplitude_m", self.amplitude_m, kHeight_m);
    visit("sigma_m", self.sigma_m, kHeight_m);
    visit("period_s", self.period_s, Bounds{0, 1e3});
    visit("limit_m", self.limit_m, kHeight_m);
  }
};

template <>
struct StoredFields<GridShape> {
  static void Fields(auto& self, const auto& visit) {
    constexpr Bounds kSide{1, kMaxGridSide};
    visit("x_min", self.x_min, kCoordinate_m);
    visit("y_min", self.y_min, kCoordinate_m);
    visit("step", self.step, Bounds{1e-5, 1});
    visit("width", self.width, kSide);
    visit("height", self.height, kSide);
  }
};

template <>
struct StoredFields<PlanningSource> {
  static void Fields(auto& self, const auto& visit) {
    constexpr Bounds kLps_mm{-1e4, 1e4};
    visit("roi", self.roi);
    visit("posture", self.posture);
    visit("isocentre_lps_mm", self.isocentre_mm, kLps_mm);
    visit("beam", self.beam);
    visit("plan_label", self.plan_label);
    visit("plan_date", self.plan_date);
    visit("approval", self.approval);
    visit("plan_uid", self.plan_uid);
    visit("structure_set_uid", self.structure_set_uid);
    visit("frame_of_reference_uid", self.frame_of_reference_uid);
    visit("slices", self.slices, kCount);
    visit("slice_spacing_m", self.slice_spacing_m, Bounds{1e-5, 0.1});
    visit("parts_apart", self.parts_apart, kCount);
    visit("parts_left_out", self.parts_left_out, kCount);
    visit("support_m", self.support_m, Bounds{-10, 10});
    visit("skin_u95_m", self.skin_u95_m, Bounds{1e-6, 0.1});
    visit.IfSet("skin_threshold_hu", self.skin_threshold_hu, Bounds{-2000, 2000});
    visit.OrAsIs("clothing_u95_m", self.surface.clothing_u95_m, Bounds{0, kMostStated_m});
    visit.OrAsIs("ct_breathing_u95_m", self.surface.ct_breathing_u95_m, Bounds{0, kMostStated_m});
  }
};

namespace {

/// The counts of the frames, which stand in an object of their own.
template <typename AnyScene>
struct FrameCounts {
  AnyScene& scene;

  static void Fields(auto& self, const auto& visit) {
    visit("total", self.scene.frames_total, kCount);
    visit("tracked", self.scene.frames_tracked, kCount);
    visit("dropped", self.scene.frames_dropped, kCount);
    visit.OrAsIs("fewer_keypoints", self.scene.frames_fewer_keypoints, kCount);
  }
};

/// What other programs may leave out is read by OrAsIs().
void SceneFields(auto& scene, auto& shape, auto& source, auto& sums, const auto& visit) {
  constexpr Bounds kCalibration{-1e12, 1e12}, kSigma{0, 1e12};
  visit("preset", scene.preset);
  visit.IfSet("source", source);
  visit("frame", scene.frame);
  visit.IfSet("planning", scene.planning);
  visit.OrAsIs("marker_dictionary", scene.room_markers.dictionary);
  visit.OrAsIs("marker_length_m", scene.room_markers.length_m, Bounds{0, 10});
  visit("reference_marker", scene.room_markers.reference, Bounds{0, 65535});
  visit.OfEach("markers", scene.markers, &SceneMarker::corners, kCoordinate_m);
  visit.OfEachOrAsIs("marker_views", scene.markers, &SceneMarker::num_views, kCount);
  visit.OfEachOrAsIs("marker_sigma_m", scene.markers, &SceneMarker::sigma_m, Bounds{0, 1e3});
  visit("heightmap", shape.grid);
  visit("keyframes", shape.num_keyframes, kCount);
  FrameCounts<std::remove_reference_t<decltype(scene)>> frames{scene};
  visit("frames", frames);
  visit.OrAsIs("longest_lost_s", scene.longest_lost_s, kTime_s);
  visit("breathing", scene.breathing);
  visit("depth_sensor", scene.depth_sensor);
  visit("sensor_profile", scene.sensor_profile);
  visit.OrAsIs("calibration", scene.calibration, kCalibration);
  visit.OrAsIs("calibration_sigma", scene.calibration_sigma, kSigma);
  visit.OrAsIs("calibration_prior_sigma", scene.calibration_prior_sigma, kSigma);
  visit("calibration_chi2_per_term", scene.calibration_chi2_per_term, kSigma);
  visit.OrAsIs("timings_s", scene.timings_s, kTime_s);
  visit.SentencesOrNone("warnings", "warning_messages", scene.warnings);
  visit.SentencesOrNone("refusals", "refusal_messages", scene.refusals);
  visit.OrAsIs("scale_doubt", scene.scale_doubt, Bounds{0, 1e3});
  visit.IfSet("sha256", sums);
}

}  // namespace
}  // namespace stored

std::string SceneJson(const Scene& scene, const std::optional<SceneSums>& sums) {
  stored::Json json = {{"format", stored::kSceneFormat}};
  const SceneShape shape{
      .num_keyframes = scene.keyframes.size(),
      .grid = scene.height_map ? std::optional(scene.height_map->grid) : std::nullopt};
  const std::optional<SceneSource> source =
      scene.planning ? std::optional(SceneSource::kDicom) : std::nullopt;
  stored::SceneFields(scene, shape, source, sums, stored::FieldWriter(json));
  // Warnings can quote file names in any encoding; invalid UTF-8 is replaced.
  return json.dump(1, ' ', false, stored::Json::error_handler_t::replace) + "\n";
}

StoredScene ParseSceneJson(std::string_view text, const std::string& name) {
  const Message remedy = say::stored_file::MakeSceneAgain();
  stored::Json json;
  try {
    json = ParseBoundedJson<stored::Json>(text);
  } catch (const DataError& error) {
    throw DataError(say::scene_file::NotJson(name, error.message()));
  }
  const stored::Found root{json, name + ": ", remedy};
  const stored::FieldReader reader(root);
  std::int64_t format = 0;
  reader("format", format);
  if (format != stored::kSceneFormat)
    throw DataError(say::scene_file::NewerFormat(name, format, stored::kSceneFormat));
  StoredScene read;
  std::optional<SceneSource> source;
  stored::SceneFields(read.scene, read.shape, source, read.sums, reader);
  const bool is_planned = source == SceneSource::kDicom;
  if (is_planned != read.scene.planning.has_value() ||
      is_planned != (read.scene.frame == SceneFrame::kIec))
    throw DataError(say::scene_file::PlanningContradicts(name));
  // Versions before 0.3.0 knew no other depth sensors than those of structured light.
  if (!is_planned && !json.contains("depth_sensor"))
    read.scene.depth_sensor = DepthSensor::kStructuredLight;
  const std::string& dictionary = read.scene.room_markers.dictionary;
  if (!dictionary.empty() && !MarkerDictionary::Find(dictionary))
    throw DataError(say::scene_file::UnknownDictionary(name, dictionary.substr(0, 60)));
  if (read.scene.markers.size() > stored::kMaxMarkers)
    throw DataError(say::scene_file::TooManyMarkers(name, stored::kMaxMarkers));
  return read;
}

}  // namespace plumb
