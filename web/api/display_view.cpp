// SPDX-License-Identifier: Apache-2.0
#include "web/api/display_view.hpp"

#include <string>
#include <utility>

#include "words/web.hpp"

namespace plumb::web {
namespace {

/// Decides by one status. Used on the loop thread.
class DisplayView {
 public:
  DisplayView(Status status, ReferenceService& references)
      : status_(std::move(status)), references_(references) {}

  /// @param arguments  The record, and the name of its file if it has one.
  [[nodiscard]] bool Shows(ShownRecord record, const std::vector<std::string>& arguments) const {
    const std::string& id = arguments.at(0);
    switch (record) {
      case ShownRecord::kNone:
        break;
      case ShownRecord::kPatient:
        return IsOpenPatient(id) || (last() && last()->patient_id == id);
      case ShownRecord::kReference:
        return (last() && last()->reference_id == id) || IsOfOpenSession(id);
      case ShownRecord::kScan:
        return last() && last()->id == id;
      case ShownRecord::kScanFile:
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
  [[nodiscard]] bool IsOfOpenSession(const std::string& reference_id) const {
    return status_.session && status_.session->reference &&
           status_.session->reference->id == reference_id;
  }
  /// The map of the last result is drawn on the grid of its reference's scene.
  [[nodiscard]] bool IsSceneOfReference(const std::string& scan_id, const std::string& file) const {
    if (file != "scene.json" || !last() || last()->reference_id.empty()) return false;
    const auto reference = references_.FindReference(last()->reference_id);
    return reference && reference->scan_id == scan_id;
  }

  Status status_;
  ReferenceService& references_;
};

}  // namespace

void LimitDisplays(Router& router, const Services& services) {
  router.Wrap([&](const Route& route) -> Handler {
    if (route.permission != Permission::kRoom || route.pattern.find('{') == std::string::npos)
      return route.handler;
    return [services, shown = route.shown, absent = route.absent, answer = route.handler](
               const Request& request, const Respond& respond) {
      if (request.session->role == Role::kDisplay) {
        if (shown == ShownRecord::kNone)
          return respond(ErrorResponse(404, say::web::NothingHere()));
        const DisplayView view(services.appliance.GetStatus(), services.references);
        if (!view.Shows(shown, request.arguments)) return respond(ErrorResponse(404, absent));
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
