// The page's service for settings and templates.
#include "daemon/appliance/web_services.hpp"

#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace plumb {

using web::ChangeResult;

namespace {

/// Names the first setting with a value that may not be entered; empty if there is none.
std::string CheckSettings(const web::SettingsChange& change) {
  const web::Settings settings = change.AppliedTo({});
  std::string wrong;
  const auto check = [&](const char* name, double value, const web::Limits& limits) {
    const auto [least, most] = limits.entered;
    if (wrong.empty() && !limits.entered.Holds(value))
      wrong = fmt::format("{}: expected {} to {}", name, least, most);
  };
  web::ForEachSetting(change, settings,
                      [&]([[maybe_unused]] const char* name, const auto&, const auto& value,
                          const auto&... limits) { (check(name, value, limits), ...); });
  if (wrong.empty() && !web::IsPosture(settings.posture))
    wrong = fmt::format("posture: expected one of {}", fmt::join(web::kPostures, ", "));
  return wrong;
}

class WebSettings final : public web::SettingsService {
 public:
  explicit WebSettings(StoreAccess& store) : store_(store) {}

  web::Settings GetSettings() override {
    return store_.Read(&Store::settings, [](SettingsStore& settings) { return settings.Get(); });
  }

  void ChangeSettings(const web::Actor& actor, const web::SettingsChange& change,
                      web::Done done) override {
    if (const std::string wrong = CheckSettings(change); !wrong.empty())
      return done(Refusal(ChangeResult::kInvalid, wrong));
    // The store's thread makes one change after the other, so none comes between reading and
    // writing.
    store_.Change(&Store::settings, std::move(done), [=](SettingsStore& stored) {
      stored.Change(actor, change.AppliedTo(change.is_complete() ? web::Settings{} : stored.Get()));
    });
  }

  std::vector<web::PlanTemplate> Templates() override {
    return store_.Read(&Store::templates,
                       [](TemplateStore& templates) { return templates.List(); });
  }

  void SetTemplate(const web::Actor& actor, const web::PlanTemplate& wanted,
                   web::Done done) override {
    store_.Change(&Store::templates, std::move(done),
                  [=](TemplateStore& templates) { templates.Set(actor, wanted); });
  }

  void RemoveTemplate(const web::Actor& actor, const std::string& site, web::Done done) override {
    store_.Change(&Store::templates, std::move(done),
                  [=](TemplateStore& templates) { templates.Remove(actor, site); });
  }

 private:
  StoreAccess& store_;
};

}  // namespace

std::unique_ptr<web::SettingsService> MakeWebSettings(StoreAccess& store) {
  return std::make_unique<WebSettings>(store);
}

}  // namespace plumb
