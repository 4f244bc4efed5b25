// SPDX-License-Identifier: Apache-2.0
#include <memory>
#include <set>

#include <Eigen/Geometry>

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "algo/base/errors.hpp"
#include "algo/base/message_json.hpp"
#include "algo/base/units.hpp"
#include "daemon/cli/ask_plumbd.hpp"
#include "daemon/cli/commands.hpp"
#include "daemon/cli/common_options.hpp"
#include "daemon/files/scene_folder.hpp"
#include "daemon/files/stored_scene.hpp"
#include "daemon/result/result_folder.hpp"
#include "drivers/dicom/planning_files.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/importers/import.hpp"
#include "drivers/live/sensor_driver.hpp"
#include "drivers/replay/tum_index.hpp"
#include "drivers/replay/tum_recording.hpp"
#include "words/cli.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

constexpr std::size_t kMaxJsonBytes = std::size_t{64} << 20;

struct InfoArguments {
  fs::path path;
  bool json = false;
};

/// Stamps of the depth images in seconds, without decoding any image.
std::vector<double> DepthStamps(const fs::path& recording, const ImportedRecording* imported) {
  if (imported != nullptr) return imported->facts().depth_s;
  if (const RecordingKind* kind = BuiltInSensors().KindOf(recording))
    return kind->DepthStamps(recording);
  std::vector<double> stamps_s;
  const fs::path index = recording / "depth.txt";
  for (const IndexEntry& entry : ParseIndex(ReadTextFile(index, kMaxJsonBytes), index.string()))
    stamps_s.push_back(entry.time_s);
  return stamps_s;
}

bool IsRecording(const fs::path& path) {
  return BuiltInSensors().KindOf(path) != nullptr || IsTumRecording(path) || IsImportable(path);
}

/// The unit of the depth images, and the camera that they are from if it is not the colour camera.
ordered_json DepthFacts(const CameraFile& camera, const StreamInfo& info) {
  ordered_json depth = {{"registered", !camera.depth_camera && !camera.depth_camera_unknown},
                        {"unit_mm", nullptr},
                        {"unit_assumed", info.depth_unit_assumed},
                        {"camera_estimated", info.depth_camera_estimated}};
  if (camera.depth_scale) depth["unit_mm"] = 1e3 / *camera.depth_scale;
  if (!camera.depth_camera) return depth;
  const Intrinsics& own = camera.depth_camera->intrinsics;
  const Eigen::Vector3d t_m = camera.depth_camera->T_color_depth.translation();
  depth["image_width"] = own.width;
  depth["image_height"] = own.height;
  depth["focal_px"] = {own.fx, own.fy};
  depth["centre_px"] = {own.cx, own.cy};
  depth["distortion"] = LensCoefficients(own);
  depth["colour_from_depth_mm"] = {1e3 * t_m.x(), 1e3 * t_m.y(), 1e3 * t_m.z()};
  depth["colour_from_depth_deg"] =
      Eigen::AngleAxisd(camera.depth_camera->T_color_depth.linear()).angle() / kDegree;
  return depth;
}

/// What was recognised of a recording of another program; null where it states nothing.
void AddImportedFacts(const ImportedFacts& imported, const StreamInfo& info, ordered_json& facts) {
  const auto stated = [](const std::string& text) {
    return text.empty() ? ordered_json() : ordered_json(text);
  };
  facts["format"] = imported.format;
  facts["calibration"] = imported.calibration;
  facts["sensor"] = {{"name", stated(imported.name)},
                     {"serial", stated(imported.serial)},
                     {"firmware", stated(imported.firmware)}};
  facts["color_images"] = imported.color_images;
  facts["depth_images"] = imported.depth_s.size();
  ordered_json& depth = facts["depth"] = DepthFacts(imported.camera, info);
  depth["stereo_baseline_mm"] = nullptr;
  if (imported.stereo_baseline_m) depth["stereo_baseline_mm"] = 1e3 * *imported.stereo_baseline_m;
}

ordered_json RecordingFacts(const fs::path& path) {
  const std::unique_ptr<FrameSource> recording = OpenRecording(path, {});
  const auto* imported = dynamic_cast<const ImportedRecording*>(recording.get());
  const StreamInfo& info = recording->info();
  const std::vector<double> depth_s = DepthStamps(path, imported);
  const double duration_s = depth_s.size() > 1 ? depth_s.back() - depth_s.front() : 0.0;
  const Intrinsics& camera = info.intrinsics;
  ordered_json facts = {
      {"kind", "recording"},
      {"frames", info.num_frames.value_or(0)},
      {"duration_s", duration_s},
      {"rate_hz", duration_s > 0 ? static_cast<double>(depth_s.size() - 1) / duration_s : 0.0},
      {"image_width", camera.width},
      {"image_height", camera.height},
      {"focal_px", {camera.fx, camera.fy}},
      {"centre_px", {camera.cx, camera.cy}},
      {"distortion", LensCoefficients(camera)},
      {"calibration", info.intrinsics_assumed            ? "assumed"
                      : fs::exists(path / "camera.yaml") ? "from camera.yaml"
                      : fs::is_directory(path)           ? "from another program's file"
                                                         : "from the file beside it"},
      {"depth_sensor", Name(info.depth_sensor)},
      {"depth_range_m", {info.usable_depth.nearest_m, info.usable_depth.farthest_m}},
      {"depth_noise",
       {{"constant_m", info.depth_noise.constant_m},
        {"linear_m_per_m", info.depth_noise.linear_m_per_m},
        {"quadratic_m_per_m2", info.depth_noise.quadratic_m_per_m2},
        {"origin_m", info.depth_noise.origin_m},
        {"grazing_m", info.depth_noise.grazing_m}}},
      {"marker_dictionary", info.room_markers.dictionary},
      {"marker_length_m", info.room_markers.length_m},
      {"reference_marker", nullptr},
      {"warnings", EnglishTexts(info.warnings)},
      {"warning_messages", MessagesJson(info.warnings)}};
  if (imported != nullptr) AddImportedFacts(imported->facts(), info, facts);
  if (const auto* images = dynamic_cast<const TumSource*>(recording.get()))
    facts["depth"] = DepthFacts(images->camera(), info);
  if (info.room_markers.reference) facts["reference_marker"] = *info.room_markers.reference;
  return facts;
}

/// Of a DICOM file; no name and no identifier of the patient.
ordered_json DicomFacts(const fs::path& path) {
  const PlanningContent content = ReadDicomFile(path);
  ordered_json facts = {{"kind", "dicom"},
                        {"modality", content.modality},
                        {"label", content.file.label},
                        {"date", content.file.date},
                        {"class_uid", content.file.class_uid},
                        {"instance_uid", content.file.instance_uid},
                        {"frame_of_reference_uid", content.file.frame_of_reference_uid}};
  if (content.structures) {
    ordered_json& rois = facts["rois"] = ordered_json::object();
    for (const PlannedRoi& roi : content.structures->rois) {
      std::size_t points = 0;
      for (const PlannedContour& contour : roi.contours) points += contour.points_mm.size();
      rois[roi.name] = {{"type", roi.type}, {"contours", roi.contours.size()}, {"points", points}};
    }
  }
  if (const auto& image = content.image) {
    facts["series_uid"] = image->series_uid;
    facts["position"] = image->position;
    facts["image_width"] = image->columns;
    facts["image_height"] = image->rows;
    facts["pixel_mm"] = {image->column_spacing_mm, image->row_spacing_mm};
    facts["first_pixel_lps_mm"] = {image->origin_mm.x(), image->origin_mm.y(),
                                   image->origin_mm.z()};
  }
  if (!content.image_fault.empty()) {
    facts["fault"] = content.image_fault.English();
    facts["fault_message"] = MessageJson(content.image_fault);
  }
  if (!content.plan) return facts;
  facts["approval"] = content.plan->approval;
  facts["geometry"] = content.plan->geometry;
  facts["structure_set_uid"] = content.plan->structure_set_uid;
  std::set<std::string> positions;
  for (const PatientSetup& setup : content.plan->setups) positions.insert(setup.position);
  facts["positions"] = positions;
  ordered_json& beams = facts["beams"] = ordered_json::object();
  for (const PlannedBeam& beam : content.plan->beams) {
    ordered_json& one =
        beams[beam.name] = {{"isocentre_lps_mm", nullptr}, {"couch_deg", beam.couch_deg}};
    if (const auto& p = beam.isocentre_mm) one["isocentre_lps_mm"] = {p->x(), p->y(), p->z()};
  }
  return facts;
}

/// One line per fact; nested values as short JSON. Sentences are in the language of the reader, so
/// their messages are not listed.
std::string Lines(const ordered_json& facts, const CommandContext& context) {
  std::string text;
  for (const auto& [key, value] : facts.items()) {
    if (key.ends_with("_message") || key.ends_with("_messages")) continue;
    const bool has_messages =
        key.ends_with("s") && facts.contains(key.substr(0, key.size() - 1) + "_messages");
    if (has_messages && !value.empty()) {
      text += fmt::format("{}\n", key);
      for (const Message& said : AllSaidIn(facts, key.substr(0, key.size() - 1)))
        text += fmt::format("  {}\n", context.Said(said));
    } else if (value.is_object()) {
      text += fmt::format("{}\n", key);
      for (const auto& [inner, v] : value.items())
        text +=
            fmt::format("  {:<32} {}\n", inner, v.is_string() ? v.get<std::string>() : v.dump());
    } else if (value.is_array() && !value.empty() && value.front().is_string()) {
      text += fmt::format("{}\n", key);
      for (const auto& v : value) text += fmt::format("  {}\n", v.get<std::string>());
    } else {
      text += fmt::format("{:<34} {}\n", key,
                          value.is_string() ? value.get<std::string>() : value.dump());
    }
  }
  return text;
}

int Run(const InfoArguments& options, const CommandContext& context) {
  ordered_json facts;
  if (IsSceneFolder(options.path)) {
    (void)ReadScene(options.path, {.cloud = false, .height_map = false, .mesh = false});
    facts = {{"kind", "scene"}};
    facts.update(ordered_json::parse(SceneText(options.path)));
  } else if (IsResultFolder(options.path)) {
    facts = {{"kind", "result"}};
    facts.update(ordered_json::parse(ResultText(ReadResult(options.path))));
  } else if (IsRecording(options.path)) {
    facts = RecordingFacts(options.path);
  } else if (IsDicomFile(options.path)) {
    facts = DicomFacts(options.path);
  } else {
    const Message why = say::cli::NothingToDescribe(options.path.string());
    RefuseUnreadFormat(options.path);
    throw DataError(fs::exists(options.path) ? why : say::cli::DoesNotExist(why));
  }
  PrintOut(options.json ? facts.dump(2, ' ', false, ordered_json::error_handler_t::replace) + "\n"
                        : Lines(facts, context));
  return kDone;
}

}  // namespace

Command AddInfo(CLI::App& app) {
  auto options = std::make_shared<InfoArguments>();
  app.add_option(
         "path", options->path,
         "A recording (folder, .oni, or another program's file), or the folder of a scene or "
         "a result, or a DICOM file")
      ->required()
      ->type_name("RECORDING|SCENE|RESULT");
  app.add_flag("--json", options->json, "Print JSON on the standard output");
  return [options](const CommandContext& context) { return Run(*options, context); };
}

}  // namespace plumb
