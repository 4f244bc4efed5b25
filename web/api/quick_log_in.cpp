// SPDX-License-Identifier: Apache-2.0
// Logging in with a PIN or a badge within a shift, and changing the person.
#include <functional>
#include <memory>
#include <utility>

#include "algo/base/errors.hpp"
#include "web/api/accounts.hpp"
#include "web/exchange/json.hpp"
#include "web/http/checks.hpp"
#include "web/model/limits.hpp"
#include "web/security/stored_password.hpp"
#include "words/audit.hpp"
#include "words/web.hpp"

namespace plumb::web {

void Accounts::AddQuickLogInRoutes(Routes& routes) {
  routes.Read("/api/v1/login/people", Permission::kNone,
              [this](const Request& request) { return ListQuickPeople(request); });
  routes.Add("POST", "/api/v1/login/pin", Permission::kNone, BodyKind::kJson,
             [this](const Request& request, const Respond& respond) {
               LogInQuickly(request, nullptr, respond);
             });
  // Not for displays: theirs is no session of a person.
  routes.Add("POST", "/api/v1/session/hand-over", Permission::kView, BodyKind::kJson,
             [this](const Request& request, const Respond& respond) {
               LogInQuickly(request, request.session, respond);
             });
  routes.Add("PUT", "/api/v1/session/pin", Permission::kView, BodyKind::kJson,
             std::bind_front(&Accounts::SetPin, this));
  AddSigned(routes, "DELETE", "/api/v1/session/pin", Permission::kView,
            [this](const Request&, Fields&) -> SignedAct {
              return [this](const Actor& actor, const Done& done) {
                users_.SetPin(actor, actor.user, std::nullopt, done);
              };
            });
}

std::optional<std::string> Accounts::DeviceOf(const Request& request, const User& user) const {
  if (user.disabled || IsFirst(user.password_hash)) return std::nullopt;
  const auto cookie = CookieValue(request.Header("cookie"), devices_.NameFor(user.name));
  return cookie ? devices_.Identify(*cookie, user.name, user.password_hash) : std::nullopt;
}

Response Accounts::ListQuickPeople(const Request& request) {
  const auto now = options_.now();
  Json people = Json::array();
  for (const std::string& name : quick_.People(now)) {
    const auto user = users_.FindUser(name);
    const auto device = user ? DeviceOf(request, *user) : std::nullopt;
    if (device && quick_.TriesLeft(*device, name, now) > 0 && users_.FindPin(name))
      people.push_back(name);
  }
  return JsonResponse({{"people", people}});
}

void Accounts::LogInQuickly(const Request& request, const std::shared_ptr<Session>& before,
                            const Respond& respond) {
  Fields fields(request.body);
  const Actor actor{fields.Text("name", 1, kMaxName), request.address};
  std::string pin = fields.Text("pin", 1, kMaxPin);
  fields.Finish();
  const auto user = users_.FindUser(actor.user);
  const auto device = user ? DeviceOf(request, *user) : std::nullopt;
  const auto hash = device ? users_.FindPin(actor.user) : std::nullopt;
  // Counted before hashing, so that PINs sent at once are as few as one after the other.
  if (!hash || !quick_.UseTry(*device, actor.user, options_.now()))
    return respond(ErrorResponse(403, say::web::PinNeedsPassword()));
  const auto finish = [=, this, user = *user](bool matches) {
    const auto still = users_.FindUser(user.name);
    const bool is_same = still && !still->disabled && still->password_hash == user.password_hash &&
                         users_.FindPin(user.name) == hash;
    if (!matches || !is_same) {
      audit_.Log(actor, "login.failed", "", say::audit::WrongPin());
      const int left = quick_.TriesLeft(*device, user.name, options_.now());
      return respond(
          ErrorResponse(403, left > 0 ? say::web::WrongPin(left) : say::web::PinNeedsPassword()));
    }
    quick_.Succeeded(*device, user.name);
    if (before) {
      sessions_.End(before);
      audit_.Log({before->user, actor.address}, "session.hand_over", user.name, {});
    }
    respond(WelcomeQuickly(*still, actor));
  };
  CheckPassword(
      std::move(pin), *hash, /*trusted=*/true, respond,
      [this, device = *device, name = actor.user] { quick_.GiveBack(device, name); }, finish);
}

Response Accounts::WelcomeQuickly(const User& user, const Actor& actor) {
  const Sessions::Opened opened = sessions_.Open(user, actor.address, options_.now());
  opened.session->is_quick = true;
  audit_.Log(actor, "login.pin", "", {});
  Response response = JsonResponse({{"user", user.name}, {"role", Name(user.role)}});
  SetCookie(response, cookie_name(), opened.token, certificate_.has_value());
  return response;
}

void Accounts::SetPin(const Request& request, const Respond& respond) {
  Fields fields(request.body);
  const auto pin = std::make_shared<std::string>(fields.Text("pin", 1, kMaxPin));
  OwnProof proof = ReadProof(fields, "password");
  fields.Finish();
  if (const Message why = WhyNotPin(*pin); !why.empty()) throw DataError(why);
  const auto user = users_.FindUser(request.session->user);
  const auto device = user ? DeviceOf(request, *user) : std::nullopt;
  VerifyOwn(request, std::move(proof), say::web::WrongPassword(), respond,
            [this, pin, device, actor = request.actor(), respond](const User& signer) {
              HashThen(std::move(*pin), respond,
                       [this, device, actor, name = signer.name, respond](const std::string& hash) {
                         users_.SetPin(actor, name, hash,
                                       WhileAlive([=, this](const Change& change) {
                                         if (change.result == ChangeResult::kDone && device)
                                           quick_.Open(*device, name, options_.now());
                                         respond(ChangeResponse(change));
                                       }));
                       });
            });
}

}  // namespace plumb::web
