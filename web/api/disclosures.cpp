#include "web/api/disclosures.hpp"

#include <algorithm>
#include <array>
#include <map>
#include <memory>
#include <string>
#include <tuple>
#include <utility>

namespace plumb::web {
namespace {

using TimePoint = std::chrono::steady_clock::time_point;

struct Disclosure {
  std::string_view pattern;
  std::string_view view;      ///< Action that is logged once per hour; empty if it is not a view.
  std::string_view download;  ///< Action that is logged each time; empty if it is not a download.
};

constexpr std::array kDisclosures = {
    Disclosure{"/result", "view.scan", ""},
    Disclosure{"/api/v1/patients", "view.patients", ""},
    Disclosure{"/api/v1/patients/{id}", "view.patient", ""},
    Disclosure{"/api/v1/patients/{id}/references", "view.patient", ""},
    Disclosure{"/api/v1/patients/{id}/scans", "view.patient", ""},
    Disclosure{"/api/v1/patients/{id}/report.pdf", "", "download.course_report"},
    Disclosure{"/api/v1/patients/{id}/course.zip", "", "download.course"},
    Disclosure{"/api/v1/patients/{id}/numbers.csv", "", "download.numbers"},
    Disclosure{"/api/v1/patients/{id}/numbers.json", "", "download.numbers"},
    Disclosure{"/api/v1/references/{id}", "view.reference", ""},
    Disclosure{"/api/v1/scans", "view.scans", ""},
    Disclosure{"/api/v1/scans/{id}", "view.scan", ""},
    Disclosure{"/api/v1/scans/{id}/report.pdf", "", "download.report"},
    Disclosure{"/api/v1/scans/{id}/files/{name}", "view.scan", "download.file"},
    Disclosure{"/api/v1/scans/{id}/maps/{name}", "view.scan", ""},
    Disclosure{"/api/v1/results/{id}", "view.scan", ""},
    Disclosure{"/api/v1/audit", "view.log", ""},
    Disclosure{"/api/v1/audit.jsonl", "", "download.log"},
    Disclosure{"/api/v1/preview", "view.camera", ""},
    Disclosure{"/api/v1/scan/surface", "view.camera", ""},
};

const Disclosure* FindDisclosure(std::string_view pattern) {
  const auto* const found = std::ranges::find(kDisclosures, pattern, &Disclosure::pattern);
  return found == kDisclosures.end() ? nullptr : found;
}

/// Used on the loop thread.
class Disclosures {
 public:
  Disclosures(AuditLog& log, std::function<TimePoint()> now) : log_(log), now_(std::move(now)) {}

  void Add(const Disclosure& disclosure, const Request& request, const Response& response) {
    if (response.status != 200 || !request.session || request.session->role == Role::kDisplay)
      return;
    const std::string subject = !response.about.empty()     ? response.about
                                : request.arguments.empty() ? std::string()
                                                            : request.arguments[0];
    const bool takes = !disclosure.download.empty() &&
                       (disclosure.view.empty() || request.query.contains("download"));
    const std::string action(takes ? disclosure.download : disclosure.view);
    if (!takes && !IsNewView({request.session->user, request.address, action, subject})) return;
    log_.Log(request.actor(), action, subject,
             takes ? request.path.substr(request.path.rfind('/') + 1) : std::string());
  }

 private:
  using View = std::tuple<std::string, std::string, std::string, std::string>;
  static constexpr std::size_t kMaxViews = 4096;

  bool IsNewView(View what) {
    const TimePoint now = now_();
    if (views_.size() >= kMaxViews) {
      std::erase_if(views_, [&](const auto& view) { return now - view.second >= kSameView; });
      // Clears all entries of the hour; logging some twice does no harm.
      if (views_.size() >= kMaxViews) views_.clear();
    }
    const auto [view, is_new] = views_.try_emplace(std::move(what), now);
    if (!is_new && now - view->second < kSameView) return false;
    view->second = now;
    return true;
  }

  AuditLog& log_;
  std::function<TimePoint()> now_;
  // Time at which user, address, action and subject were last logged.
  std::map<View, TimePoint> views_;
};

}  // namespace

bool DisclosesPatientData(std::string_view pattern) { return FindDisclosure(pattern) != nullptr; }

void LogDisclosures(Router& router, AuditLog& log, std::function<TimePoint()> now) {
  const auto disclosures = std::make_shared<Disclosures>(log, std::move(now));
  router.Wrap([&](const Route& route) -> Handler {
    const Disclosure* const found = FindDisclosure(route.pattern);
    if (found == nullptr || route.method != "GET") return route.handler;
    return [disclosures, found, answer = route.handler](const Request& request,
                                                        const Respond& respond) {
      answer(request, [disclosures, found, request, respond](Response response) {
        disclosures->Add(*found, request, response);
        respond(std::move(response));
      });
    };
  });
}

}  // namespace plumb::web
