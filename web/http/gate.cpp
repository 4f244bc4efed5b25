#include "web/http/gate.hpp"

#include <sodium.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "algo/base/errors.hpp"
#include "web/http/checks.hpp"

namespace plumb::web {
namespace {

bool IsType(std::string_view header, std::string_view type) {
  const std::string_view value = header.substr(0, header.find(';'));
  return std::equal(value.begin(), value.end(), type.begin(), type.end(),
                    [](char a, char b) { return std::tolower(a) == b; });
}

Response InternalError(std::string_view name, const std::exception& error) {
  std::fprintf(stderr, "web: %.*s: %s\n", static_cast<int>(name.size()), name.data(), error.what());
  return ErrorResponse(500, "internal error; the journal has the details");
}

/// Turns a handler's exception into an answer. A refusal by the disk is stated, as it is in safe
/// mode.
Response AnswerOf(std::string_view name, const std::exception& error) {
  if (dynamic_cast<const DataError*>(&error) != nullptr) return ErrorResponse(400, error.what());
  if (dynamic_cast<const IoError*>(&error) != nullptr) return ErrorResponse(500, error.what());
  return InternalError(name, error);
}

bool SameToken(std::string_view a, std::string_view b) {
  return a.size() == b.size() && sodium_memcmp(a.data(), b.data(), a.size()) == 0;
}

}  // namespace

bool Gate::IsOwnPage(const Request& request) const {
  const std::string_view site = request.Header("sec-fetch-site");
  if (!site.empty() && site != "same-origin" && site != "none") return false;
  const std::string_view origin = request.Header("origin");
  return origin.empty() || IsSameOrigin(origin, request.Header("host"), tls_);
}

Response Gate::NotLoggedIn() const {
  Response response;
  response.status = 401;
  response.body =
      nlohmann::json{
          {"error", "log in first"},
          {"setup_required", sessions_.needs_setup()},
          {"fault", sessions_.accounts_fault()},
          {"certificate", sessions_.needs_setup() ? sessions_.tls_fingerprint() : std::string()}}
          .dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  return response;
}

std::variant<const Route*, Response> Gate::Admit(Request& request) const {
  if (!IsKnownHost(request.Header("host"), host_names_)) {
    return ErrorResponse(
        421,
        "unknown host name; use the appliance's address, or add the name to its configuration");
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
    if (match.allowed.empty()) return ErrorResponse(404, "nothing was found at this address");
    Response response = ErrorResponse(405, "this address accepts only " + match.allowed);
    response.headers.emplace_back("Allow", match.allowed);
    return response;
  }
  const Route& route = *match.route;
  request.arguments = std::move(match.arguments);
  if (route.permission != Permission::kNone) {
    if (!request.session) return NotLoggedIn();
    if (!May(request.session->role, route.permission))
      return ErrorResponse(403, "your role is not allowed to do this");
    if (request.session->must_change_password && route.permission != Permission::kLogin)
      return ErrorResponse(403, "choose a password of your own first");
  } else if (request.session && request.session->must_change_password) {
    request.session.reset();  // for pages that show more to logged-in users
  }
  if (request.method != "GET") {
    if (!IsOwnPage(request))
      return ErrorResponse(403, "this request was made by a page of another site");
    if (route.permission != Permission::kNone &&
        !SameToken(request.Header("x-csrf-token"), request.session->csrf_token)) {
      return ErrorResponse(403,
                           "the token of this session is missing or wrong; load the page again");
    }
  }
  const std::string_view type = request.Header("content-type");
  if (route.body == BodyKind::kJson && !IsType(type, "application/json"))
    return ErrorResponse(415, "expected application/json");
  if (route.body == BodyKind::kForm && !IsType(type, "application/x-www-form-urlencoded"))
    return ErrorResponse(415, "expected a form");
  if (route.body == BodyKind::kFile && !IsType(type, "application/octet-stream"))
    return ErrorResponse(415, "expected application/octet-stream");
  return &route;
}

void Gate::Handle(const Route& route, const Request& request, const Respond& respond) {
  if (route.body == BodyKind::kNone && !request.body.empty())
    return respond(ErrorResponse(400, "expected no body"));
  // The body may have taken long, and the account may have been disabled meanwhile.
  if (route.permission != Permission::kNone && request.session->ended)
    return respond(ErrorResponse(401, "the session has ended: log in again"));
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
  respond(RetryLater(503, "too many requests at once; try again in a few seconds",
                     std::chrono::seconds(2)));
}

void AddSecurityHeaders(Response& response, bool tls) {
  const auto add = [&](const char* name, const char* value) {
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
  if (tls) add("Strict-Transport-Security", "max-age=31536000");
  add("Cache-Control",
      response.cache_for_ever ? "public, max-age=31536000, immutable" : "no-store");
}

}  // namespace plumb::web
