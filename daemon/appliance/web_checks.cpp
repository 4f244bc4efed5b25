#include "daemon/appliance/web_checks.hpp"

#include <utility>

namespace plumb {

web::CheckStatus WebChecks::GetChecks() {
  return store_.Read([this](Store&) { return appliance_.Checks(); });
}

void WebChecks::OpenCheck(const web::Actor& actor, web::Done done) {
  if (const std::string refusal = appliance_.OpenCheck(actor); !refusal.empty())
    return done(AnswerOf(refusal));
  store_.Change(&Store::audit, std::move(done),
                [=](AuditStore& audit) { audit.Log(actor, "check.open", "", ""); });
}

void WebChecks::SetCheckBaseline(const web::Actor& actor, const std::string& check_id,
                                 web::Done done) {
  store_.Change(&Store::checks, std::move(done),
                [=](CheckStore& checks) { checks.SetBaseline(actor, check_id); });
}

}  // namespace plumb
