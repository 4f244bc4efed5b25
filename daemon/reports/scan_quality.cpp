// SPDX-License-Identifier: Apache-2.0
#include "daemon/reports/scan_quality.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "algo/base/errors.hpp"
#include "algo/base/units.hpp"
#include "daemon/files/scene_folder.hpp"
#include "daemon/reports/text_report.hpp"
#include "daemon/result/axis_names.hpp"
#include "daemon/result/result_folder.hpp"
#include "web/service/result_terms.hpp"
#include "words/acceptance.hpp"
#include "words/comparison.hpp"
#include "words/result.hpp"
#include "words/text_report.hpp"

namespace plumb {
namespace {

using web::ScanQuality;

/// Share of lost frames from which the page and the reports mention them.
constexpr double kManyLost = 0.05;

/// Collects the rows.
class Rows {
 public:
  explicit Rows(std::vector<web::QualityRow>& rows) : rows_(rows) {}

  void Add(Message name, Message value, bool is_caution = false) {
    rows_.push_back({std::move(name), std::move(value), is_caution});
  }
  /// A number that is not finite is shown as "not known", with a caution.
  void AddNumber(Message name, double value, Message (*said)(double), bool is_caution = false) {
    if (std::isfinite(value)) return Add(std::move(name), said(value), is_caution);
    Add(std::move(name), say::result::NotKnown(), true);
  }

 private:
  std::vector<web::QualityRow>& rows_;
};

void AddComparisonTo(Rows& rows, const StoredResult& result) {
  if (const auto& planned = result.compared_with) {
    rows.Add(say::text_report::Reference(), ComparedWith(*planned),
             planned->skin_threshold_hu.has_value());
    if (Message stated = SurfaceStated(*planned); !stated.empty())
      rows.Add(say::text_report::Surface(), std::move(stated));
  }
  if (const auto& alignment = result.alignment) {
    rows.Add(say::result::QualityMarkers(),
             say::result::QualityCount(static_cast<std::int64_t>(alignment->markers_used.size())));
    rows.AddNumber(say::result::QualityMisfit(), alignment->rms_m / kMillimetre,
                   [](double mm) { return say::result::QualityFineLength(mm); });
  }
  if (const auto& region = result.region) {
    rows.AddNumber(
        say::result::QualityCovered(), 100 * region->coverage,
        [](double percent) { return say::result::QualityShare(percent); },
        region->coverage < region->min_coverage);
    rows.AddNumber(
        say::result::QualityHole(), region->largest_hole_m / kMillimetre,
        [](double mm) { return say::result::QualityLength(mm); },
        region->largest_hole_m > region->max_hole_m);
  }
  if (const auto& motion = result.motion) {
    const auto& [median, p95] = motion->residual_m;
    const bool is_known = std::isfinite(median) && std::isfinite(p95);
    rows.Add(say::result::QualityFit(),
             is_known ? say::result::QualitySpread(median / kMillimetre, p95 / kMillimetre)
                      : say::result::NotKnown(),
             !is_known);
  }
}

double LostShare(const Scene& scene) {
  if (scene.frames_total <= 0) return 0.0;
  return static_cast<double>(scene.frames_dropped) / static_cast<double>(scene.frames_total);
}

void AddSweepTo(Rows& rows, const StoredScene& stored) {
  const Scene& scene = stored.scene;
  if (scene.planning) return;  // no sweep made it
  rows.Add(say::result::QualityTracked(),
           say::result::QualityTrackedOf(scene.frames_tracked, scene.frames_total));
  const double lost = LostShare(scene);
  rows.Add(say::result::QualityLost(),
           say::result::QualityLostShare(scene.frames_dropped, 100 * lost), lost >= kManyLost);
  if (scene.longest_lost_s > 0)
    rows.Add(say::result::QualityGap(), say::result::QualityTime(scene.longest_lost_s), true);
  rows.Add(say::result::QualityKeyframes(),
           say::result::QualityCount(static_cast<std::int64_t>(stored.shape.num_keyframes)));
  if (const auto scale = scene.calibration.find("depth_scale"); scale != scene.calibration.end())
    rows.Add(say::result::QualityDepthScale(),
             say::result::QualityChange(100 * (scale->second - 1)));
}

std::vector<web::QualityRow> RowsOf(const Scan& scan, const ScanFiles& files) {
  std::vector<web::QualityRow> collected;
  Rows rows(collected);
  if (files.result) AddComparisonTo(rows, *files.result);
  if (files.scene) AddSweepTo(rows, *files.scene);
  if (!scan.sensor_serial.empty())
    rows.Add(say::result::QualitySensor(), say::result::QualityText(scan.sensor_serial));
  if (scan.sensor_on_s)
    rows.Add(say::result::QualitySensorOn(), say::result::QualityMinutes(*scan.sensor_on_s / 60));
  if (!files.result) return collected;
  if (const auto& room = files.result->room_calibration) {
    rows.Add(
        say::result::QualityRoom(),
        room->used ? say::result::QualityVersion(room->version) : say::result::QualityRoomNotUsed(),
        !room->used);
  }
  // The program that computed the result, which may be older than the one that shows it.
  rows.Add(say::result::QualityComputedWith(), say::result::QualityProgram(files.result->version));
  return collected;
}

std::vector<Message> CautionsOf(const Scan& scan, const ScanFiles& files, double warm_up_min) {
  std::vector<Message> cautions;
  if (files.scene) {
    const double lost = LostShare(files.scene->scene);
    if (lost >= kManyLost) cautions.push_back(say::result::ReportFramesLost(100 * lost));
  }
  if (scan.sensor_on_s && *scan.sensor_on_s < 60 * warm_up_min)
    cautions.push_back(
        say::result::ReportWarming(static_cast<std::int64_t>(*scan.sensor_on_s / 60)));
  if (Message caution = web::DailyCheckCaution(scan.daily_check); !caution.empty())
    cautions.push_back(std::move(caution));
  return cautions;
}

/// What the comparison could not rely on. That the room's calibration was not used is a warning.
void AddRemarksTo(std::vector<Message>& remarks, const StoredResult& result) {
  if (result.body && !result.body->room_known) remarks.push_back(say::result::ReportRoomUnknown());
  if (const auto& alignment = result.alignment) {
    for (const auto& [id, residual_m] : alignment->markers_rejected)
      remarks.push_back(say::result::ReportMarkerIgnored(id, residual_m / kMillimetre));
  }
  if (const auto& motion = result.motion) {
    const std::array<Message, 6> names = AxisNames(result.body);
    for (const StoredWeakDirection& weak : motion->weak_directions) {
      const auto axis = std::ranges::find(kNumberNames, weak.name);
      remarks.push_back(say::result::ReportWeakDirection(
          axis == kNumberNames.end()
              ? Message::Verbatim(weak.name)
              : names.at(static_cast<std::size_t>(axis - kNumberNames.begin()))));
    }
  }
  remarks.insert(remarks.end(), result.warnings.begin(), result.warnings.end());
}

template <typename Read>
auto ReadOrSay(std::vector<Message>& unreadable, const Read& read)
    -> std::optional<decltype(read())> {
  try {
    return read();
  } catch (const MessageError& error) {
    unreadable.push_back(error.message());
    return std::nullopt;
  }
}

}  // namespace

ScanFiles FilesOf(const Scan& scan) {
  ScanFiles files;
  if (scan.folder.empty()) return files;
  const std::filesystem::path scene = scan.folder / "scene", result = scan.folder / "result";
  if (IsSceneFolder(scene))
    files.scene = ReadOrSay(files.unreadable, [&] { return ReadStoredScene(scene); });
  if (IsResultFolder(result))
    files.result = ReadOrSay(files.unreadable, [&] { return ReadResult(result); });
  return files;
}

ScanQuality QualityOf(const Scan& scan, const ScanFiles& files, double warm_up_min) {
  ScanQuality quality{.rows = RowsOf(scan, files),
                      .cautions = CautionsOf(scan, files, warm_up_min),
                      .remarks = files.unreadable,
                      .why_not_accept = {}};
  if (const double lost = files.scene ? LostShare(files.scene->scene) : 0.0; lost > kMostLostFrames)
    quality.why_not_accept = say::result::TooManyLost(100 * lost, 100 * kMostLostFrames);
  if (files.result) AddRemarksTo(quality.remarks, *files.result);
  if (files.scene) {
    // The remarks may hold them already: a comparison repeats the warnings of its scans.
    for (const Message& warning : files.scene->scene.warnings) {
      const std::array<Message, 2> said = {
          warning, say::comparison::ScanWarned(say::acceptance::ScanCurrent(), warning)};
      if (std::ranges::find_first_of(quality.remarks, said) == quality.remarks.end())
        quality.remarks.push_back(warning);
    }
  }
  return quality;
}

}  // namespace plumb
