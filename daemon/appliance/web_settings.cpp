// The page's service for settings and templates.
#include "daemon/appliance/web_services.hpp"

#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "web/service/limits.hpp"

namespace plumb {

using web::ChangeResult;

namespace {

std::string CheckSettings(const web::Settings& s) {
  struct Field {
    const char* name;
    double value;
    web::Range range;
  };
  for (const Field& field :
       {Field{"tolerance.shift_mm", s.tolerance.shift_mm, web::kShiftTolerance_mm},
        Field{"tolerance.rotation_deg", s.tolerance.rotation_deg, web::kRotationTolerance_deg},
        Field{"auto_stop_s", s.auto_stop_s, web::kAutoStop_s},
        Field{"scan_limit_s", s.scan_limit_s, web::kScanLimit_s},
        Field{"retention_days", static_cast<double>(s.retention_days), web::kRetention_days},
        Field{"idle_logout_min", static_cast<double>(s.idle_logout_min), web::kIdleLogout_min}}) {
    if (!field.range.Holds(field.value))
      return fmt::format("{}: expected {} to {}", field.name, field.range.least, field.range.most);
  }
  if (!web::IsPosture(s.posture))
    return fmt::format("posture: expected one of {}", fmt::join(web::kPostures, ", "));
  return {};
}

class WebSettings final : public web::SettingsService {
 public:
  explicit WebSettings(StoreAccess& store) : store_(store) {}

  web::Settings GetSettings() override {
    return store_.Read(&Store::settings, [](SettingsStore& settings) { return settings.Get(); });
  }

  void ChangeSettings(const web::Actor& actor, const web::SettingsChange& change,
                      web::Done done) override {
    if (const std::string wrong = CheckSettings(change.AppliedTo({})); !wrong.empty()) {
      return done(Refusal(ChangeResult::kInvalid, wrong));
    }
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
