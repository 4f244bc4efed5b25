// SPDX-License-Identifier: Apache-2.0
#include "web/api/disclosures.hpp"

#include <map>
#include <memory>
#include <string>
#include <tuple>
#include <utility>

namespace plumb::web {
namespace {

using TimePoint = std::chrono::steady_clock::time_point;

/// Used on the loop thread.
class Disclosures {
 public:
  Disclosures(AuditLog& log, std::function<TimePoint()> now) : log_(log), now_(std::move(now)) {}

  void Add(std::string_view view, std::string_view download, const Request& request,
           const Response& response) {
    if (response.status != 200 || !request.session || request.session->role == Role::kDisplay)
      return;
    const std::string subject = !response.about.empty()     ? response.about
                                : request.arguments.empty() ? std::string()
                                                            : request.arguments[0];
    const bool takes = !download.empty() && (view.empty() || request.query.contains("download"));
    const std::string action(takes ? download : view);
    if (!takes && !IsNewView({request.session->user, request.address, action, subject})) return;
    log_.Log(
        request.actor(), action, subject,
        takes ? Message::Verbatim(request.path.substr(request.path.rfind('/') + 1)) : Message());
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

void LogDisclosures(Router& router, AuditLog& log, std::function<TimePoint()> now) {
  const auto disclosures = std::make_shared<Disclosures>(log, std::move(now));
  router.Wrap([&](const Route& route) -> Handler {
    if (!route.DisclosesPatientData()) return route.handler;
    return [disclosures, view = route.view, download = route.download, answer = route.handler](
               const Request& request, const Respond& respond) {
      answer(request, [disclosures, view, download, request, respond](Response response) {
        disclosures->Add(view, download, request, response);
        respond(std::move(response));
      });
    };
  });
}

}  // namespace plumb::web
