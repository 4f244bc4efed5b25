// SPDX-License-Identifier: Apache-2.0
// What another unit of the clinic may ask: whether a patient is open here.
#include <string>
#include <string_view>

#include "web/api/all_routes.hpp"
#include "web/api/watching/bearer.hpp"
#include "web/exchange/json.hpp"
#include "web/security/patient_hash.hpp"
#include "web/security/secrets.hpp"

namespace plumb::web {

void AddPeerRoute(Routes& routes, ApplianceService& appliance, const std::string& secret) {
  if (secret.empty()) return;
  routes.Read("/peers/open", Permission::kNone, [secret, &appliance](const Request& request) {
    if (!IsBearerOf(request, secret)) return NotTheBearer();
    const auto asked = request.query.find("patient");
    const Status status = appliance.GetStatus();
    const bool is_open =
        asked != request.query.end() && status.session &&
        IsSameSecret(asked->second, PatientHash(status.session->patient_code, secret));
    return JsonResponse({{"open", is_open}});
  });
}

}  // namespace plumb::web
