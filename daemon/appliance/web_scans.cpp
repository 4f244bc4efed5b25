// The page's service for scans.
#include "daemon/appliance/web_services.hpp"

#include <algorithm>
#include <deque>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "daemon/appliance/reports.hpp"
#include "daemon/files/compact_map.hpp"
#include "daemon/loop/log.hpp"

namespace plumb {

namespace {

class WebScans final : public web::ScanService {
 public:
  WebScans(Appliance& appliance, StoreAccess& store) : appliance_(appliance), store_(store) {}

  std::vector<Scan> Scans(const std::string& patient_id, int limit) override {
    return store_.Read(&Store::scans,
                       [&](ScanStore& scans) { return scans.List(patient_id, limit); });
  }

  std::optional<Scan> FindScan(const std::string& id) override {
    return store_.Read(&Store::scans, [&](ScanStore& scans) { return scans.Find(id); });
  }

  void AcceptScan(const Actor& actor, const std::string& id, const std::string& reason,
                  Done done) override {
    if (appliance_.IsRunning())
      return done(AnswerOf("a scan is running: accept its result, not an older one"));
    const std::optional<Scan> scan = FindScan(id);
    if (!scan) return done(Refused(ChangeResult::kNotFound, "there is no such scan"));
    // A scan from an earlier run of the appliance is too old to act on.
    if (scan->result && appliance_.AgeOf(id).value_or(kResultValid_s + 1) > kResultValid_s)
      return done(AnswerOf("this result is older than 2 minutes: scan again, then accept"));
    // Another person may be on the couch by now.
    const auto open = appliance_.WebStatus().session;
    if (!scan->patient_id.empty() && (!open || open->patient_id != scan->patient_id))
      return done(AnswerOf("the session of this patient is not open: a result is accepted in it"));
    store_.Write(&Store::scans, std::move(done),
                 [=](ScanStore& scans) { scans.Accept(actor, id, reason); });
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

  web::ResultNotes Notes(const std::string& scan_id, web::Language language) override {
    return store_.Read([&](Store& store) -> web::ResultNotes {
      const std::optional<Scan> scan = store.scans.Find(scan_id);
      return scan ? NotesOf(SourcesIn(store), *scan, language) : web::ResultNotes{};
    });
  }

  std::optional<std::string> PictureOf(const std::string& scan_id, web::ComparisonPicture picture,
                                       web::Language language) override {
    return store_.Read([&](Store& store) -> std::optional<std::string> {
      const std::optional<Scan> scan = store.scans.Find(scan_id);
      if (!scan || scan->folder.empty()) return std::nullopt;
      // Held while drawing, so that a second request for the same scan waits instead of drawing
      // too.
      const std::lock_guard lock(drawn_mutex_);
      auto found = std::ranges::find_if(drawn_, [&](const Drawn& one) {
        return one.scan_id == scan_id && one.language == language;
      });
      if (found == drawn_.end()) {
        std::vector<std::string> pngs = ComparisonPngs(SourcesIn(store), *scan, language);
        if (pngs.empty()) return std::nullopt;
        constexpr std::size_t kMaxDrawn = 2;  // one scan in both languages
        std::erase_if(drawn_, [&](const Drawn& one) { return !store.scans.Find(one.scan_id); });
        drawn_.push_front({scan_id, language, std::move(pngs)});
        if (drawn_.size() > kMaxDrawn) drawn_.pop_back();
        found = drawn_.begin();
      }
      const auto wanted = static_cast<std::size_t>(picture);
      return wanted < found->pngs.size() ? std::optional(found->pngs[wanted]) : std::nullopt;
    });
  }

  std::optional<std::string> ScanReport(const std::string& scan_id,
                                        web::Language language) override {
    return store_.Read([&](Store& store) -> std::optional<std::string> {
      const std::optional<Scan> scan = store.scans.Find(scan_id);
      return scan ? std::optional(ScanReportPdf(SourcesIn(store), *scan, language)) : std::nullopt;
    });
  }

  std::optional<std::string> CourseReport(const std::string& patient_id,
                                          web::Language language) override {
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
    web::Language language;
    std::vector<std::string> pngs;
  };
  /// A surface as it goes to the page; the file that it was packed from never changes.
  struct Packed {
    std::string scan_id, bytes;
  };

  ReportSources SourcesIn(Store& store) const {
    return {store.patients, store.references, store.scans, appliance_.references().warm_up_min(),
            [this](const MarkerMap& scene) { return appliance_.room().In(scene); }};
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
  StoreAccess& store_;
  std::mutex drawn_mutex_;
  /// The newest ones: a page asks for both pictures at once, and the one without script every 10 s.
  std::deque<Drawn> drawn_;
  std::mutex packed_mutex_;
  /// The newest ones: each viewer of a result asks for its surface, and for that of the reference.
  std::deque<Packed> packed_;
};

}  // namespace

std::unique_ptr<web::ScanService> MakeWebScans(Appliance& appliance, StoreAccess& store) {
  return std::make_unique<WebScans>(appliance, store);
}

}  // namespace plumb
