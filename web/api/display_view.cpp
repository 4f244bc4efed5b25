#include "web/api/display_view.hpp"

#include <algorithm>
#include <array>
#include <string>
#include <string_view>
#include <utility>

namespace plumb::web {
namespace {

enum class Subject : std::uint8_t { kPatient, kReference, kScan, kScanFile };

struct ShownRoute {
  std::string_view pattern;
  Subject subject;
  const char* absent;  ///< The route's answer where there is no such record.
};

constexpr std::array kShownRoutes = {
    ShownRoute{"/api/v1/patients/{id}", Subject::kPatient, "no such patient"},
    ShownRoute{"/api/v1/references/{id}", Subject::kReference, "no such reference"},
    ShownRoute{"/api/v1/scans/{id}", Subject::kScan, "no such scan"},
    ShownRoute{"/api/v1/scans/{id}/files/{name}", Subject::kScanFile, "no such scan"},
    ShownRoute{"/api/v1/scans/{id}/maps/{name}", Subject::kScan, "this scan has no such map"},
    ShownRoute{"/api/v1/results/{id}", Subject::kScan, "no such scan"},
};

/// Decides by one status. Used on the loop thread.
class DisplayView {
 public:
  DisplayView(Status status, PatientService& patients, ReferenceService& references)
      : status_(std::move(status)), patients_(patients), references_(references) {}

  /// @param arguments  The record, and the name of its file if it has one.
  [[nodiscard]] bool Shows(Subject subject, const std::vector<std::string>& arguments) const {
    const std::string& id = arguments.at(0);
    switch (subject) {
      case Subject::kPatient:
        return IsOpenPatient(id) || (last() && last()->patient_id == id);
      case Subject::kReference:
        return (last() && last()->reference_id == id) || IsOfOpenPatient(id);
      case Subject::kScan:
        return last() && last()->id == id;
      case Subject::kScanFile:
        return (last() && last()->id == id) || IsSceneOfReference(id, arguments.at(1));
    }
    return false;
  }

 private:
  [[nodiscard]] const std::optional<Scan>& last() const { return status_.last_result; }
  [[nodiscard]] bool IsOpenPatient(const std::string& id) const {
    return status_.session && status_.session->patient_id == id;
  }
  /// The surface that grows during a sweep has the sides of the posture that is planned there.
  [[nodiscard]] bool IsOfOpenPatient(const std::string& reference_id) const {
    if (!status_.session) return false;
    const auto patient = patients_.FindPatient(status_.session->patient_id);
    return patient && patient->approved_reference_id == reference_id;
  }
  /// The map of the last result is drawn on the grid of its reference's scene.
  [[nodiscard]] bool IsSceneOfReference(const std::string& scan_id, const std::string& file) const {
    if (file != "scene.json" || !last() || last()->reference_id.empty()) return false;
    const auto reference = references_.FindReference(last()->reference_id);
    return reference && reference->scan_id == scan_id;
  }

  Status status_;
  PatientService& patients_;
  ReferenceService& references_;
};

}  // namespace

void LimitDisplays(Router& router, const Services& services) {
  router.Wrap([&](const Route& route) -> Handler {
    if (route.permission != Permission::kRoom || route.pattern.find('{') == std::string::npos)
      return route.handler;
    const auto* const known = std::ranges::find(kShownRoutes, route.pattern, &ShownRoute::pattern);
    const ShownRoute* const shown = known == kShownRoutes.end() ? nullptr : known;
    return
        [services, shown, answer = route.handler](const Request& request, const Respond& respond) {
          if (request.session->role == Role::kDisplay) {
            if (shown == nullptr)
              return respond(ErrorResponse(404, "nothing was found at this address"));
            const DisplayView view(services.appliance.GetStatus(), services.patients,
                                   services.references);
            if (!view.Shows(shown->subject, request.arguments))
              return respond(ErrorResponse(404, shown->absent));
          }
          answer(request, respond);
        };
  });
}

bool IsForDisplay(const Scan& scan, const Status& status) {
  const std::string open_session = status.session ? status.session->id : std::string();
  const bool is_last = status.last_result && status.last_result->id == scan.id;
  return scan.session_id == open_session && (is_last || scan.outcome == ScanOutcome::kFailed);
}

}  // namespace plumb::web
