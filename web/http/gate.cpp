// SPDX-License-Identifier: Apache-2.0
#include "web/http/gate.hpp"

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <nlohmann/json.hpp>

#include <fmt/format.h>

#include "algo/base/ascii_lower.hpp"
#include "algo/base/errors.hpp"
#include "algo/base/message_json.hpp"
#include "web/http/checks.hpp"
#include "web/security/secrets.hpp"
#include "web/security/tls_identity.hpp"
#include "words/web.hpp"

namespace plumb::web {
namespace {

bool IsType(std::string_view header, std::string_view type) {
  const std::string_view value = header.substr(0, header.find(';'));
  return std::equal(value.begin(), value.end(), type.begin(), type.end(),
                    [](char a, char b) { return AsciiLower(a) == b; });
}

Response InternalError(std::string_view name, const std::exception& error) {
  std::fprintf(stderr, "web: %.*s: %s\n", static_cast<int>(name.size()), name.data(), error.what());
  return ErrorResponse(500, say::web::InternalError());
}

/// Turns a handler's exception into an answer. A refusal by the disk is stated, as it is in safe
/// mode.
Response AnswerOf(std::string_view name, const std::exception& error) {
  if (dynamic_cast<const DataError*>(&error) != nullptr)
    return ErrorResponse(400, MessageOf(error));
  if (dynamic_cast<const IoError*>(&error) != nullptr) return ErrorResponse(500, MessageOf(error));
  return InternalError(name, error);
}

}  // namespace

Message Gate::WhyNotOwnPage(const Request& request) const {
  const std::string_view site = request.Header("sec-fetch-site");
  if (!site.empty() && site != "same-origin" && site != "none") return say::web::OtherSite();
  const std::string_view origin = request.Header("origin"), host = request.Header("host");
  if (origin.empty() || IsSameOrigin(origin, host, tls_)) return {};
  // The cookies of such a browser would not be kept to TLS.
  if (!tls_ && IsSameOrigin(origin, host, /*tls=*/true)) return say::web::ProxyWithoutTls();
  return say::web::OtherSite();
}

Response Gate::NotLoggedIn() const {
  using Json = nlohmann::ordered_json;
  const Message why = say::web::LogInFirst();
  const Message& fault = sessions_.accounts_fault();
  Response response;
  response.status = 401;
  response.body =
      Json{{"error", why.English()},
           {"error_message", MessageJson(why)},
           {"setup_required", sessions_.needs_setup()},
           {"fault", fault.English()},
           {"fault_message", fault.empty() ? Json(nullptr) : MessageJson(fault)},
           {"certificate", sessions_.needs_setup() ? sessions_.tls_fingerprint() : std::string()}}
          .dump(-1, ' ', false, Json::error_handler_t::replace);
  return response;
}

std::variant<const Route*, Response> Gate::Admit(Request& request) const {
  if (!IsKnownHost(request.Header("host"), host_names_) &&
      !IsKnownHost(request.Header("host"), OwnNames())) {
    return ErrorResponse(421, say::web::UnknownHost());
  }
  Router::Match match = router_.Find(request.method, request.path);
  const bool api = request.path.starts_with("/api/");
  // Requests that the page makes on its own, without user action, do not keep a session alive.
  const bool touch = request.Header("x-plumb-background").empty() &&
                     request.path != "/api/v1/events" &&
                     !(request.path == "/result" && request.query.contains("again"));
  request.session = sessions_.SessionOf(request, touch);
  if (match.route == nullptr) {
    if (api && !request.session) return NotLoggedIn();
    if (match.allowed.empty()) return ErrorResponse(404, say::web::NothingHere());
    Response response = ErrorResponse(405, say::web::AcceptsOnly(match.allowed));
    response.headers.emplace_back("Allow", match.allowed);
    return response;
  }
  const Route& route = *match.route;
  request.arguments = std::move(match.arguments);
  if (route.permission != Permission::kNone) {
    if (!request.session) return NotLoggedIn();
    if (!request.session->May(route.permission))
      return ErrorResponse(403, say::web::RoleNotAllowed());
    if (request.session->must_change_password && route.permission != Permission::kLogin)
      return ErrorResponse(403, say::web::ChooseOwnPassword());
  } else if (request.session && request.session->must_change_password) {
    request.session.reset();  // for pages that show more to logged-in users
  }
  if (request.method != "GET") {
    if (Message why = WhyNotOwnPage(request); !why.empty())
      return ErrorResponse(403, std::move(why));
    if (route.permission != Permission::kNone &&
        !IsSameSecret(request.Header("x-csrf-token"), request.session->csrf_token)) {
      return ErrorResponse(403, say::web::WrongToken());
    }
  }
  const std::string_view type = request.Header("content-type");
  if (route.body == BodyKind::kJson && !IsType(type, "application/json"))
    return ErrorResponse(415, say::web::ExpectedJson());
  if (route.body == BodyKind::kForm && !IsType(type, "application/x-www-form-urlencoded"))
    return ErrorResponse(415, say::web::ExpectedForm());
  if (route.body == BodyKind::kFile && !IsType(type, "application/octet-stream"))
    return ErrorResponse(415, say::web::ExpectedBytes());
  return &route;
}

void Gate::Handle(const Route& route, const Request& request, const Respond& respond) {
  if (route.body == BodyKind::kNone && !request.body.empty())
    return respond(ErrorResponse(400, say::web::ExpectedNoBody()));
  // The body may have taken long, and the account may have been disabled meanwhile.
  if (route.permission != Permission::kNone && request.session->ended)
    return respond(ErrorResponse(401, say::web::SessionEnded()));
  RespondGuarded(
      route.Name(), [&] { route.handler(request, respond); }, respond);
}

void RespondGuarded(const std::string& name, const std::function<void()>& rest,
                    const Respond& respond) {
  try {
    rest();
  } catch (const std::exception& error) {
    respond(AnswerOf(name, error));
  }
}

void RespondInBackground(BackgroundWork& background, const std::string& name,
                         std::function<Response()> make, const Respond& respond) {
  auto made = std::make_shared<Response>();
  const auto work = [made, name, make = std::move(make)] {
    try {
      *made = make();
    } catch (const std::exception& error) {
      *made = AnswerOf(name, error);
    }
  };
  if (background.RunInBackground(BackgroundPool::kReads, work,
                                 [made, respond] { respond(std::move(*made)); }))
    return;
  respond(RetryLater(503, say::web::TooManyRequests(), std::chrono::seconds(2)));
}

void AddSecurityHeaders(Response& response, std::optional<std::chrono::seconds> certificate_left) {
  const auto add = [&](const char* name, const std::string& value) {
    response.headers.emplace_back(name, value);
  };
  add("Content-Security-Policy",
      "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; connect-src "
      "'self'; base-uri 'none'; "
      "form-action 'self'; frame-ancestors 'none'");
  add("X-Content-Type-Options", "nosniff");
  add("X-Frame-Options", "DENY");
  add("Referrer-Policy", "same-origin");  // "no-referrer" would make the Origin of a form "null"
  add("Cross-Origin-Opener-Policy", "same-origin");
  add("Cross-Origin-Resource-Policy", "same-origin");
  add("Permissions-Policy", "camera=(), microphone=(), geolocation=(), usb=()");
  constexpr std::chrono::seconds kYear{365 * 24 * 3600}, kNone{0};
  if (certificate_left)
    add("Strict-Transport-Security",
        fmt::format("max-age={}", std::clamp(*certificate_left, kNone, kYear).count()));
  add("Cache-Control",
      response.cache_for_ever ? "public, max-age=31536000, immutable" : "no-store");
}

}  // namespace plumb::web
