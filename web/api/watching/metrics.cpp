// SPDX-License-Identifier: Apache-2.0
#include "web/api/watching/metrics.hpp"

#include <cmath>
#include <iterator>
#include <string>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include "algo/base/names.hpp"
#include "web/api/all_routes.hpp"
#include "web/api/watching/bearer.hpp"
#include "web/exchange/routes.hpp"

namespace plumb::web {
namespace {

/// Text for a label: it may hold anything that a sensor or a version calls itself.
std::string Escaped(std::string_view text) {
  std::string escaped;
  for (const char c : text) {
    if (c == '\\' || c == '"') escaped += '\\';
    escaped += c == '\n' ? ' ' : c;
  }
  return escaped;
}

class MetricsWriter {
 public:
  /// Opens a family. @param unit  The last word of its name, or empty.
  MetricsWriter& Family(std::string_view name, std::string_view type, std::string_view unit,
                        std::string_view help) {
    name_ = name;
    Add("# TYPE plumb_{} {}\n", name, type);
    if (!unit.empty()) Add("# UNIT plumb_{} {}\n", name, unit);
    Add("# HELP plumb_{} {}\n", name, help);
    return *this;
  }
  MetricsWriter& Sample(double value) { return Sample("", "", value); }
  /// @param labels  "verdict=\"move\"", or empty.
  MetricsWriter& Sample(std::string_view suffix, const std::string& labels, double value) {
    Add("plumb_{}{}", name_, suffix);
    if (!labels.empty()) Add("{{{}}}", labels);
    if (value == std::floor(value) && std::abs(value) < 1e15)
      Add(" {:.0f}\n", value);
    else
      Add(" {:.6g}\n", value);
    return *this;
  }
  template <typename E>
  void States(E now) {
    for (const std::string_view of : kNamesOf<E>)
      Sample("", fmt::format("plumb_{}=\"{}\"", name_, of), of == Name(now) ? 1 : 0);
  }
  [[nodiscard]] std::string Text() const { return text_ + "# EOF\n"; }

 private:
  template <typename... Args>
  void Add(fmt::format_string<Args...> format, Args&&... args) {
    fmt::format_to(std::back_inserter(text_), format, std::forward<Args>(args)...);
  }
  std::string text_, name_;
};

double AgeOf(WallClock::time_point then, WallClock::time_point now) {
  return std::chrono::duration<double>(now - then).count();
}

void WriteChecks(const Status& status, WallClock::time_point now, MetricsWriter& out) {
  out.Family("daily_check", "stateset", "", "Today's check of the room's markers.")
      .States(status.daily_check);
  if (!status.last_check) return;
  const CheckRecord& check = *status.last_check;
  out.Family("check_age_seconds", "gauge", "seconds", "Time since the newest check.")
      .Sample(AgeOf(check.time, now));
  out.Family("check_limit_ratio", "gauge", "ratio",
             "Values of the newest check by their limits, from which 1 on it fails; scale and "
             "depth_scale show the sensor's drift.");
  for (const CheckItem& item : check.items) {
    if (!item.value || !(item.limit > 0) || item.name == "markers_seen") continue;
    out.Sample("", fmt::format("item=\"{}\"", Escaped(item.name)),
               std::abs(*item.value) / item.limit);
  }
}

void WriteStorage(const StorageStatus& storage, WallClock::time_point now, MetricsWriter& out) {
  out.Family("storage_free_bytes", "gauge", "bytes", "Room left for scans.")
      .Sample(static_cast<double>(storage.free_bytes));
  out.Family("storage_size_bytes", "gauge", "bytes", "Size of the disk for scans.")
      .Sample(static_cast<double>(storage.total_bytes));
  out.Family("storage_writable", "gauge", "", "1: scans can be stored.").Sample(storage.writable);
  out.Family("storage_warnings", "gauge", "", "Warnings about disk and backups on the page.")
      .Sample(static_cast<double>(storage.warnings.size()));
  if (!storage.backup_made_at) return;
  out.Family("backup_age_seconds", "gauge", "seconds",
             "Age of the newest backup in the configured folder; absent without one.")
      .Sample(AgeOf(*storage.backup_made_at, now));
}

void WriteMessages(const std::vector<MessageWay>& ways, MetricsWriter& out) {
  if (ways.empty()) return;
  out.Family("messages", "counter", "", "Messages to people outside since the start.");
  for (const MessageWay& way : ways) {
    const auto count = [&](const char* outcome, std::int64_t number) {
      out.Sample("_total", fmt::format("way=\"{}\",outcome=\"{}\"", Escaped(way.name), outcome),
                 static_cast<double>(number));
    };
    count("sent", way.sent);
    count("failed", way.failed);
  }
  out.Family("messages_failing", "gauge", "", "1: the newest attempt of this way failed.");
  for (const MessageWay& way : ways)
    out.Sample("", fmt::format("way=\"{}\"", Escaped(way.name)), !way.failure.empty());
}

void WriteScans(const ScanCounts& counts, MetricsWriter& out) {
  out.Family("scans", "counter", "", "Scans that ended since the start.");
  for (std::size_t i = 0; i < counts.verdicts.size(); ++i)
    out.Sample("_total", fmt::format("outcome=\"{}\"", Name(static_cast<Verdict>(i))),
               static_cast<double>(counts.verdicts[i]));
  out.Sample("_total", "outcome=\"without_comparison\"",
             static_cast<double>(counts.without_comparison));
  out.Sample("_total", "outcome=\"cancelled\"", static_cast<double>(counts.cancelled));
  out.Sample("_total", "outcome=\"failed\"", static_cast<double>(counts.failed));
  out.Family("frames", "counter", "", "Images of the sweeps of these scans.")
      .Sample("_total", "", static_cast<double>(counts.frames));
  out.Family("frames_dropped", "counter", "", "Of these, images that could not be processed.")
      .Sample("_total", "", static_cast<double>(counts.frames_dropped));
  if (!counts.answer_s) return;
  out.Family("answer_seconds", "gauge", "seconds",
             "Of the newest scan, time from its last image until everything was stored.")
      .Sample(*counts.answer_s);
}

}  // namespace

std::string MetricsText(const Status& status, const Health& health, WallClock::time_point now,
                        std::optional<std::chrono::seconds> certificate_left) {
  MetricsWriter out;
  out.Family("build", "info", "", "The version that runs.")
      .Sample("_info", fmt::format("version=\"{}\"", Escaped(status.version)), 1);
  out.Family("healthy", "gauge", "", "1: as GET /health says.").Sample(health.ok);
  out.Family("state", "stateset", "", "What the unit does.").States(status.state);
  out.Family("fault", "stateset", "", "Why it cannot scan.").States(status.fault_kind);
  out.Family("sensor_present", "gauge", "", "1: a sensor is attached.")
      .Sample(status.sensor.present);
  out.Family("sensor_frame_rate_hertz", "gauge", "hertz", "Pairs of images a second.")
      .Sample(status.sensor.frames_per_second);
  out.Family("sensor_on_seconds", "gauge", "seconds", "Time since the sensor was attached.")
      .Sample(status.sensor.powered_s);
  out.Family("warnings", "gauge", "", "Warnings about the unit's set-up on the page.")
      .Sample(static_cast<double>(status.warnings.size()));
  out.Family("references_waiting", "gauge", "", "References that wait for a plan or an approval.")
      .Sample(static_cast<double>(status.waiting.size()));
  if (certificate_left)
    out.Family("certificate_left_seconds", "gauge", "seconds",
               "Time until the page's certificate ends; negative afterwards.")
        .Sample(static_cast<double>(certificate_left->count()));
  WriteChecks(status, now, out);
  WriteStorage(status.storage, now, out);
  WriteScans(status.counts, out);
  WriteMessages(status.messages, out);
  return out.Text();
}

void AddMetricsRoute(Routes& routes, ApplianceService& appliance, const std::string& token,
                     std::function<std::optional<std::chrono::seconds>()> certificate_left) {
  if (token.empty()) return;
  routes.Read("/metrics", Permission::kNone, [=, &appliance](const Request& request) {
    if (!IsBearerOf(request, token)) return NotTheBearer();
    return BodyResponse(kMetricsType, MetricsText(appliance.GetStatus(), appliance.GetHealth(),
                                                  WallClock::now(), certificate_left()));
  });
}

}  // namespace plumb::web
