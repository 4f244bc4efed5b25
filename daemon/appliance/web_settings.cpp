#include "daemon/appliance/web_settings.hpp"

#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace plumb {

using web::ChangeResult;

namespace {

/// Names a setting that nobody may enter; empty if there is none.
std::string CheckSettings(const web::SettingsChange& change) {
  const web::Settings settings = change.AppliedTo({});
  std::string wrong;
  const auto check = [&](const char* name, double value, const web::Limits& limits) {
    const auto [least, most] = limits.entered;
    if (!limits.entered.Holds(value))
      wrong = fmt::format("{}: expected {} to {}", name, least, most);
  };
  web::ForEachSetting(change, settings,
                      [&]([[maybe_unused]] const char* name, const auto&, const auto& value,
                          const auto&... limits) { (check(name, value, limits), ...); });
  if (!web::IsPosture(settings.posture))
    wrong = fmt::format("posture: expected one of {}", fmt::join(web::kPostures, ", "));
  return wrong;
}

}  // namespace

web::Settings WebSettings::GetSettings() {
  return store_.Read(&Store::settings, [](SettingsStore& settings) { return settings.Get(); });
}

void WebSettings::ChangeSettings(const web::Actor& actor, const web::SettingsChange& change,
                                 web::Done done) {
  if (const std::string wrong = CheckSettings(change); !wrong.empty())
    return done(Refusal(ChangeResult::kInvalid, wrong));
  // The store's thread makes one change after the other, so none comes between reading and writing.
  store_.Change(&Store::settings, std::move(done), [=](SettingsStore& stored) {
    stored.Change(actor, change.AppliedTo(change.is_complete() ? web::Settings{} : stored.Get()));
  });
}

std::vector<web::PlanTemplate> WebSettings::Templates() {
  return store_.Read(&Store::templates, [](TemplateStore& templates) { return templates.List(); });
}

void WebSettings::SetTemplate(const web::Actor& actor, const web::PlanTemplate& wanted,
                              web::Done done) {
  store_.Change(&Store::templates, std::move(done),
                [=](TemplateStore& templates) { templates.Set(actor, wanted); });
}

void WebSettings::RemoveTemplate(const web::Actor& actor, const std::string& site, web::Done done) {
  store_.Change(&Store::templates, std::move(done),
                [=](TemplateStore& templates) { templates.Remove(actor, site); });
}

}  // namespace plumb
