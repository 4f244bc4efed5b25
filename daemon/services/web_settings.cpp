// SPDX-License-Identifier: Apache-2.0
// The page's service for settings and templates.
#include "daemon/services/web_services.hpp"

#include <utility>

#include "words/scan.hpp"

namespace plumb {

namespace {

/// Names the first setting with a value that may not be entered; empty if there is none.
Message CheckSettings(const SettingsChange& change) {
  const Settings settings = change.AppliedTo({});
  Message wrong;
  const auto check = [&](const char* name, double value, const Limits& limits) {
    const auto [least, most] = limits.entered;
    if (wrong.empty() && !limits.entered.Holds(value))
      wrong = say::scan::SettingRange(name, least, most);
  };
  ForEachSetting(change, settings,
                 [&]([[maybe_unused]] const char* name, const auto&, const auto& value,
                     const auto&... limits) { (check(name, value, limits), ...); });
  if (wrong.empty() && !IsPosture(settings.posture))
    wrong = say::scan::SettingPosture({kPostures.begin(), kPostures.end()});
  if (wrong.empty() && !IsAcceptLive(settings.accept_live)) wrong = say::scan::SettingAcceptLive();
  if (wrong.empty() && !IsReportPaper(settings.paper)) wrong = say::scan::SettingPaper();
  return wrong;
}

class WebSettings final : public web::SettingsService {
 public:
  WebSettings(Notices& notices, StoreAccess& store) : notices_(notices), store_(store) {}

  Settings GetSettings() override {
    return store_.Read(&Store::settings, [](SettingsStore& settings) { return settings.Get(); });
  }

  void ChangeSettings(const Actor& actor, const SettingsChange& change, Done done) override {
    if (const Message wrong = CheckSettings(change); !wrong.empty())
      return done(Refused(ChangeResult::kInvalid, wrong));
    // The store's thread makes one change after the other, so none comes between reading and
    // writing.
    // The status says what the next sweep needs.
    const Done told = [this, done = std::move(done)](const Change& answer) {
      notices_.TellPage(web::EventKind::kStatus);
      done(answer);
    };
    store_.Write(&Store::settings, told, [=](SettingsStore& stored) {
      stored.Change(actor, change.AppliedTo(change.is_complete() ? Settings{} : stored.Get()));
    });
  }

  std::vector<PlanTemplate> Templates() override {
    return store_.Read(&Store::templates,
                       [](TemplateStore& templates) { return templates.List(); });
  }

  void SetTemplate(const Actor& actor, const PlanTemplate& wanted, Done done) override {
    store_.Write(&Store::templates, std::move(done),
                 [=](TemplateStore& templates) { templates.Set(actor, wanted); });
  }

  void RemoveTemplate(const Actor& actor, const std::string& site, Done done) override {
    store_.Write(&Store::templates, std::move(done),
                 [=](TemplateStore& templates) { templates.Remove(actor, site); });
  }

 private:
  Notices& notices_;
  StoreAccess& store_;
};

}  // namespace

std::unique_ptr<web::SettingsService> MakeWebSettings(Notices& notices, StoreAccess& store) {
  return std::make_unique<WebSettings>(notices, store);
}

}  // namespace plumb
