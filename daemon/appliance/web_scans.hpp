// The page's service for scans.
#pragma once

#include <deque>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "daemon/appliance/reports.hpp"
#include "daemon/appliance/store_access.hpp"
#include "web/service/scan_service.hpp"

namespace plumb {

/// Its arguments are borrowed.
class WebScans : public web::ScanService {
 public:
  WebScans(Appliance& appliance, StoreAccess& store) : appliance_(appliance), store_(store) {}

  [[nodiscard]] std::vector<web::Scan> Scans(const std::string& patient_id, int limit) override;
  [[nodiscard]] std::optional<web::Scan> FindScan(const std::string& id) override;
  void AcceptScan(const web::Actor& actor, const std::string& id, const std::string& reason,
                  web::Done done) override;
  void RemoveScan(const web::Actor& actor, const std::string& id, const std::string& reason,
                  web::Done done) override;
  [[nodiscard]] std::optional<std::string> CompactMap(const std::string& scan_id,
                                                      const std::string& name) override;
  [[nodiscard]] web::ResultNotes Notes(const std::string& scan_id, web::Language language) override;
  [[nodiscard]] std::optional<std::string> PictureOf(const std::string& scan_id,
                                                     web::ComparisonPicture picture,
                                                     web::Language language) override;
  [[nodiscard]] std::optional<std::string> ScanReport(const std::string& scan_id,
                                                      web::Language language) override;
  [[nodiscard]] std::optional<std::string> CourseReport(const std::string& patient_id,
                                                        web::Language language) override;

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
  [[nodiscard]] ReportSources SourcesIn(Store& store) const;
  /// @throws DataError if there is none, or it cannot be read.
  [[nodiscard]] std::string SurfaceOf(const web::Scan& scan);

  Appliance& appliance_;
  StoreAccess& store_;
  std::mutex drawn_mutex_;
  /// The newest ones: a page asks for both pictures at once, and the one without script every 10 s.
  std::deque<Drawn> drawn_;
  std::mutex packed_mutex_;
  /// The newest ones: each viewer of a result asks for its surface, and for that of the reference.
  std::deque<Packed> packed_;
};

}  // namespace plumb
