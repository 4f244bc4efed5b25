// SPDX-License-Identifier: Apache-2.0
// The page's service for scans.
#include "daemon/services/web_services.hpp"

#include <algorithm>
#include <deque>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "daemon/files/compact_map.hpp"
#include "daemon/loop/log.hpp"
#include "daemon/reports/reports.hpp"
#include "daemon/reports/scan_quality.hpp"
#include "words/scan.hpp"
#include "words/store.hpp"

namespace plumb {

namespace {

class WebScans final : public web::ScanService {
 public:
  WebScans(Appliance& appliance, const ReferenceGate& references, const RoomInUse& room,
           StoreAccess& store, std::function<void()> accepted)
      : appliance_(appliance),
        references_(references),
        room_(room),
        store_(store),
        accepted_(std::move(accepted)) {}

  std::vector<Scan> Scans(const std::string& patient_id, int limit) override {
    return store_.Read(&Store::scans,
                       [&](ScanStore& scans) { return scans.List(patient_id, limit); });
  }

  std::optional<Scan> FindScan(const std::string& id) override {
    return store_.Read(&Store::scans, [&](ScanStore& scans) { return scans.Find(id); });
  }

  void AcceptScan(const Actor& actor, const std::string& id, const std::string& reason,
                  Done done) override {
    if (!appliance_.WhyNotIdle().empty()) return done(AnswerOf(say::scan::AcceptNewest()));
    const std::optional<Scan> scan = FindScan(id);
    if (!scan) return done(Refused(ChangeResult::kNotFound, say::store::NoScan()));
    // A scan from an earlier run of the appliance is too old to act on.
    const Status status = appliance_.WebStatus();
    const bool is_last = status.last_result && status.last_result->id == id;
    const bool is_valid = is_last && status.last_result->age_s.has_value() &&
                          *status.last_result->age_s <= kResultValid_s;
    if (is_last && status.last_result->is_superseded)
      return done(AnswerOf(say::store::ScanNotNewest()));
    if (scan->result && !is_valid) return done(AnswerOf(say::scan::ResultTooOld()));
    // Another person may be on the couch by now, or the same one on another day.
    const auto& open = status.session;
    if (!scan->patient_id.empty() && (!open || open->id != scan->session_id))
      return done(AnswerOf(say::scan::AcceptInSession()));
    if (const Message why = QualityOf(id).why_not_accept; !why.empty()) return done(AnswerOf(why));
    const auto then = [accepted = accepted_, done = std::move(done)](const Change& change) {
      if (change.result == ChangeResult::kDone) accepted();
      done(change);
    };
    store_.Write(&Store::scans, then, [=](ScanStore& scans) { scans.Accept(actor, id, reason); });
  }

  void RemoveScan(const Actor& actor, const std::string& id, const std::string& reason,
                  Done done) override {
    store_.Write(&Store::removal, std::move(done),
                 [=](StoreRemoval& removal) { removal.RemoveScan(actor, id, reason); });
  }

  std::optional<std::string> CompactMap(const std::string& scan_id,
                                        const std::string& name) override {
    const std::optional<Scan> scan = FindScan(scan_id);
    if (!scan || scan->folder.empty()) return std::nullopt;
    try {
      return name == "mesh" ? SurfaceOf(*scan) : plumb::CompactMap(scan->folder, name);
    } catch (const std::exception& error) {
      plumb::Log(LogLevel::kNotice,
                 fmt::format("no map {} of scan {}: {}", name, scan_id, error.what()));
      return std::nullopt;
    }
  }

  web::ScanQuality QualityOf(const std::string& scan_id) override {
    return store_.Read([&](Store& store) -> web::ScanQuality {
      const std::optional<Scan> scan = store.scans.Find(scan_id);
      return scan ? plumb::QualityOf(*scan, FilesOf(*scan), references_.warm_up_min())
                  : web::ScanQuality{};
    });
  }

  std::optional<std::string> PictureOf(const std::string& scan_id, web::ComparisonPicture picture,
                                       const Catalogue& language) override {
    return store_.Read([&](Store& store) -> std::optional<std::string> {
      const std::optional<Scan> scan = store.scans.Find(scan_id);
      if (!scan || scan->folder.empty()) return std::nullopt;
      // Held while drawing, so that a second request for the same scan waits instead of drawing
      // too.
      const std::lock_guard lock(drawn_mutex_);
      auto found = std::ranges::find_if(drawn_, [&](const Drawn& one) {
        return one.scan_id == scan_id && one.language == &language;
      });
      if (found == drawn_.end()) {
        std::vector<std::string> pngs = ComparisonPngs(SourcesIn(store), *scan, language);
        if (pngs.empty()) return std::nullopt;
        constexpr std::size_t kMaxDrawn = 2;  // one scan in two languages
        std::erase_if(drawn_, [&](const Drawn& one) { return !store.scans.Find(one.scan_id); });
        drawn_.push_front({scan_id, &language, std::move(pngs)});
        if (drawn_.size() > kMaxDrawn) drawn_.pop_back();
        found = drawn_.begin();
      }
      const auto wanted = static_cast<std::size_t>(picture);
      return wanted < found->pngs.size() ? std::optional(found->pngs[wanted]) : std::nullopt;
    });
  }

  std::optional<std::string> ScanReport(const std::string& scan_id,
                                        const Catalogue& language) override {
    return store_.Read([&](Store& store) -> std::optional<std::string> {
      const std::optional<Scan> scan = store.scans.Find(scan_id);
      return scan ? std::optional(ScanReportPdf(SourcesIn(store), *scan, language)) : std::nullopt;
    });
  }

  std::optional<std::string> CourseReport(const std::string& patient_id,
                                          const Catalogue& language) override {
    return store_.Read([&](Store& store) -> std::optional<std::string> {
      const std::optional<Patient> patient = store.patients.Find(patient_id);
      return patient ? std::optional(CourseReportPdf(SourcesIn(store), *patient, language))
                     : std::nullopt;
    });
  }

 private:
  /// The pictures of a scan in a language. The files that they are drawn from never change.
  struct Drawn {
    std::string scan_id;
    const Catalogue* language;
    std::vector<std::string> pngs;
  };
  /// A surface as it goes to the page; the file that it was packed from never changes.
  struct Packed {
    std::string scan_id, bytes;
  };

  ReportSources SourcesIn(Store& store) const {
    return {store.patients,
            store.references,
            store.scans,
            references_.warm_up_min(),
            [this](const MarkerMap& scene) { return room_.In(scene); },
            store.couch.Get(),
            PaperIn(store)};
  }

  /// Settings that cannot be read stop no report.
  static std::string PaperIn(Store& store) {
    try {
      return store.settings.Get().paper;
    } catch (const DataError&) {
      return Settings{}.paper;
    }
  }

  /// @throws DataError if there is none, or it cannot be read.
  std::string SurfaceOf(const Scan& scan) {
    // Held while packing, so that a second request for the same scan waits instead of packing too.
    const std::lock_guard lock(packed_mutex_);
    const auto found =
        std::ranges::find_if(packed_, [&](const Packed& one) { return one.scan_id == scan.id; });
    if (found != packed_.end()) return found->bytes;
    std::string bytes = plumb::CompactMap(scan.folder, "mesh");
    constexpr std::size_t kMaxPacked = 2;  // a scan and its reference
    std::erase_if(packed_, [&](const Packed& one) { return !FindScan(one.scan_id); });
    packed_.push_front({scan.id, std::move(bytes)});
    if (packed_.size() > kMaxPacked) packed_.pop_back();
    return packed_.front().bytes;
  }

  Appliance& appliance_;
  const ReferenceGate& references_;
  const RoomInUse& room_;
  StoreAccess& store_;
  const std::function<void()> accepted_;
  std::mutex drawn_mutex_;
  /// The newest ones: a page asks for both pictures at once, and the one without script every 10 s.
  std::deque<Drawn> drawn_;
  std::mutex packed_mutex_;
  /// The newest ones: each viewer of a result asks for its surface, and for that of the reference.
  std::deque<Packed> packed_;
};

}  // namespace

std::unique_ptr<web::ScanService> MakeWebScans(Appliance& appliance,
                                               const ReferenceGate& references,
                                               const RoomInUse& room, StoreAccess& store,
                                               std::function<void()> accepted) {
  return std::make_unique<WebScans>(appliance, references, room, store, std::move(accepted));
}

}  // namespace plumb
