// SPDX-License-Identifier: Apache-2.0
#include "web/api/watching/bearer.hpp"

#include "web/security/secrets.hpp"
#include "words/web.hpp"

namespace plumb::web {

bool IsBearerOf(const Request& request, std::string_view token) {
  constexpr std::string_view kBearer = "Bearer ";
  const std::string_view given = request.Header("authorization");
  return given.starts_with(kBearer) && IsSameSecret(given.substr(kBearer.size()), token);
}

Response NotTheBearer() {
  Response refused = ErrorResponse(401, say::web::NotTheMetricsToken());
  refused.headers.emplace_back("WWW-Authenticate", "Bearer");
  return refused;
}

}  // namespace plumb::web
