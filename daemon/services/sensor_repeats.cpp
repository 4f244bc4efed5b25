// SPDX-License-Identifier: Apache-2.0
#include "daemon/services/sensor_repeats.hpp"

#include <algorithm>
#include <chrono>
#include <optional>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "algo/base/bounded_json.hpp"
#include "algo/base/errors.hpp"
#include "daemon/files/scene_folder.hpp"
#include "daemon/result/measured_repeats.hpp"
#include "words/store.hpp"

namespace plumb {
namespace {

using Json = nlohmann::ordered_json;
constexpr std::chrono::hours kTogether{1};

std::int64_t SecondsOf(WallClock::time_point time) {
  return std::chrono::duration_cast<std::chrono::seconds>(time.time_since_epoch()).count();
}

/// What of a judgement decides whether another one is due.
struct Judged {
  std::int64_t made_s = 0, profile_version = 0;
};

std::optional<Judged> JudgedIn(const std::string& text) {
  try {
    const Json json = ParseBoundedJson<Json>(text);
    return Judged{json.at("made_s").get<std::int64_t>(),
                  json.at("profile_version").get<std::int64_t>()};
  } catch (const std::exception&) {  // damaged: as if there were none
    return std::nullopt;
  }
}

}  // namespace

SensorRepeats RepeatsOf(const std::string& serial, const std::vector<Scan>& scans,
                        const ProfileShelf& shelf, WallClock::time_point now) {
  SensorRepeats repeats;
  repeats.serial = serial;
  const std::string text = shelf.Repeats(serial).value_or("");
  const std::optional<Judged> judged = JudgedIn(text);
  if (judged) repeats.judged = text;
  const std::vector<ProfileVersion> versions = shelf.Versions(serial);
  repeats.is_due = !judged || std::ranges::any_of(versions, [&](const ProfileVersion& one) {
    const bool begins_again =
        one.cause == ProfileCause::kReset || one.cause == ProfileCause::kUnreadable;
    return begins_again && one.version > judged->profile_version;
  });
  for (const Scan& scan : scans) {
    const bool is_one = scan.patient_id.empty() && scan.purpose == ScanPurpose::kFraction &&
                        scan.outcome == ScanOutcome::kDone && scan.sensor_serial == serial;
    const bool is_new = scan.started_at > now - kTogether &&
                        (!judged || SecondsOf(scan.started_at) >= judged->made_s);
    if (is_one && is_new && repeats.sweeps.size() < kRepeatsWanted)
      repeats.sweeps.push_back({scan.id, scan.started_at});
  }
  std::ranges::reverse(repeats.sweeps);
  return repeats;
}

void JudgeRepeatsOf(const SensorRepeats& repeats, const std::vector<Scan>& scans,
                    const CompareOptions& options, const Actor& actor, ProfileShelf& shelf,
                    WallClock::time_point now) {
  if (repeats.sweeps.size() < kRepeatsWanted)
    throw DataError(
        say::store::RepeatsTooFew(static_cast<int>(repeats.sweeps.size()), kRepeatsWanted));
  std::vector<Scene> scenes;
  std::vector<std::string> names, ids;
  for (const SensorRepeats::Sweep& sweep : repeats.sweeps) {
    const auto scan = std::ranges::find(scans, sweep.scan_id, &Scan::id);
    scenes.push_back(ReadScene(scan->folder / "scene"));
    ids.push_back(sweep.scan_id);
    names.push_back(fmt::format("{} ({})", ids.size(), sweep.scan_id));
  }
  Json json = RepeatsJson(MeasureRepeats(scenes, names, options));
  json["user"] = actor.user;
  json["made_s"] = SecondsOf(now);
  json["profile_version"] = shelf.Read(repeats.serial).version;
  json["scans"] = ids;
  shelf.KeepRepeats(repeats.serial, json.dump(1) + "\n");
}

}  // namespace plumb
